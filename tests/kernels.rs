//! Property and derivative tests of the kernels, one module per room.

#[path = "kernels/gauss_newton.rs"]
mod gauss_newton;
#[path = "kernels/rotation.rs"]
mod rotation;
