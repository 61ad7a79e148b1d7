//! Other users of the machine read command lines, files and errors.
