//! Property and derivative tests of the kernels, one module per room.

mod ellipsoid;
mod gauss_newton;
mod made_session;
mod norm_invariant;
mod session_model;
