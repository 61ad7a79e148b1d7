//! `mon3tr-dev apk`, built here without an NDK, as Android's own programs see what comes out.

mod built;
mod install;
mod package;
mod refusals;
mod tools;
