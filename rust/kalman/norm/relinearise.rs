//! Repeated runs over all poses, linearised at the latest constants, until convergence.

use super::{N_PARAMETERS, NormFilter, NormPrior, transition};
use crate::error::Result;
use crate::kalman::timeline::Timeline;
use crate::kalman::ud::{Innovation, UdFilter};

/// A run over all poses that moves every parameter by less than this part of its standard error is the last.
const CONVERGED: f64 = 1e-6;

/// A step longer than this many standard errors must lower the cost; shorter ones end at the fixed point of the runs,
/// which is not exactly the minimum of the cost, whose weights depend on the constants too.
const LOOKED_AT: f64 = 0.1;
/// A step that does not lower the cost is halved at most this often.
const MOST_HALVINGS: usize = 12;

impl NormFilter {
    /// Filter over all poses with every pose linearised at `theta`.
    fn run(&mut self, theta: &[f64], prior: &NormPrior) -> Result<(UdFilter, Vec<Innovation>)> {
        let mut filter = Self::start(&self.shapings, self.n_noise, prior);
        let mut timeline = Timeline::default();
        let mut innovations = Vec::with_capacity(self.poses.len());
        for i in 0..self.poses.len() {
            let pose = self.poses[i];
            let gap = timeline.gap(pose.start, pose.pose_s)?;
            filter.predict(transition(
                &mut self.steps,
                &self.shapings,
                self.n_noise,
                gap,
                pose.pose_s,
            ));
            timeline.pass(pose.start, pose.pose_s);
            innovations.push(self.update_at(&mut filter, &pose, theta));
        }
        Ok((filter, innovations))
    }

    /// Squared normalised innovations with the constants fixed at `theta`, and its squared distance from the prior.
    ///
    /// The weights are those at `theta`: towards `S = 0` the noise in m/s² vanishes together with the signal, so that
    /// the trivial solution `S = 0`, `|b| = |g|` costs as much as no fit at all.
    fn cost(&mut self, theta: &[f64]) -> Result<f64> {
        let mut fixed = self.prior.clone();
        fixed.mean.copy_from_slice(theta);
        fixed.sigma = [0.0; N_PARAMETERS];
        let (_, innovations) = self.run(theta, &fixed)?;
        let data: f64 = innovations
            .iter()
            .map(|y| y.value * y.value / y.variance)
            .sum();
        let away: f64 = (0..N_PARAMETERS)
            .map(|i| ((theta[i] - self.prior.mean[i]) / self.prior.sigma[i]).powi(2))
            .sum();
        let cost = data + away;
        Ok(if cost.is_finite() {
            cost
        } else {
            f64::INFINITY
        })
    }

    /// Repeats the run over all poses, linearised at the latest constants, until they converge. Returns the number of
    /// runs, or `None` when `most` were not enough.
    ///
    /// Starts from the best of the latest constants, those of the last call and the prior's mean; a long step is
    /// shortened until it lowers the cost.
    ///
    /// # Errors
    /// Never for poses that were accepted once.
    pub fn relinearise(&mut self, most: usize) -> Result<Option<usize>> {
        let mut theta = self.prior.mean.to_vec();
        let mut cost = self.cost(&theta)?;
        for candidate in [self.settled.clone(), self.filter.x[self.n_noise..].to_vec()] {
            let its = self.cost(&candidate)?;
            if its < cost {
                (theta, cost) = (candidate, its);
            }
        }
        let mut runs = None;
        for run in 1..=most {
            let (filter, innovations) = self.run(&theta, &self.prior.clone())?;
            self.filter = filter;
            self.innovations = innovations;
            let moved = self.moved(&self.filter, &theta);
            if moved < CONVERGED {
                runs = Some(run);
                break;
            }
            let from = theta.clone();
            self.approach(&mut theta, &self.filter.x[self.n_noise..]);
            if moved > LOOKED_AT {
                let mut its = self.cost(&theta)?;
                for _ in 0..MOST_HALVINGS {
                    if its < cost {
                        break;
                    }
                    for (value, start) in theta.iter_mut().zip(&from) {
                        *value = 0.5 * (*value + start);
                    }
                    its = self.cost(&theta)?;
                }
                cost = its;
            }
        }
        if runs.is_none() {
            // The last run's estimate is a full step from `theta`, of unknown cost.
            let estimate = self.filter.x[self.n_noise..].to_vec();
            if self.cost(&estimate)? > cost {
                self.filter.x[self.n_noise..].copy_from_slice(&theta);
            }
        }
        self.settled = theta;
        Ok(runs)
    }
}
