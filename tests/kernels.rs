//! Property and derivative tests of the kernels, one module per room.

#[path = "kernels/gauss_newton.rs"]
mod gauss_newton;
#[path = "kernels/poisson.rs"]
mod poisson;
#[path = "kernels/rotation.rs"]
mod rotation;
#[path = "kernels/stillness.rs"]
mod stillness;

#[path = "kernels/kalman.rs"]
mod kalman;
