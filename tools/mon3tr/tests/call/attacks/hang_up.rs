//! Clients and servers close connections at every moment.
