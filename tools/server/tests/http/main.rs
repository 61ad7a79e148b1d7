//! The server as its clients see it: over sockets, with a store on a disk.

mod abuse;
mod access;
mod calls;
mod child;
mod ice;
mod link_client;
mod members;
mod owners;
mod packages;
mod processes;
mod revoked;
mod rooms;
mod scale_out;
mod support;
mod tls;
