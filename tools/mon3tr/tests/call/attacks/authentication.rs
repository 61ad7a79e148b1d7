//! A server in the middle changes offers, answers and names.
