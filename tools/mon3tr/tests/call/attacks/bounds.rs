//! One owner, link holder or address exhausts what the server shares among all.
