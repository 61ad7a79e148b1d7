//! Holders of a call link watch without a seat, take seats and disconnect members.
