//! The noise strengths of largest evidence for a hypothesis: a search along one after the other, in logarithms
//! (docs/model-session.md, 11.18).

use std::ops::Range;

use super::hypothesis::{Hypothesis, Weighed};
use super::{N_SCATTER, Strengths};

/// Scatter that counts as none, in units of the session's reference.
pub const NO_SCATTER: f64 = 1e-3;
/// First index of each kind of strength: corner times, scatters, departures between poses, excess of moves.
const SCATTER_AT: usize = 2;
const BETWEEN_AT: usize = SCATTER_AT + N_SCATTER;
const EXCESS_AT: usize = BETWEEN_AT + 2;
const N_STRENGTHS: usize = EXCESS_AT + 2;
/// Indices of the scatters of either sensor.
const SCATTER_OF: [Range<usize>; 2] = [SCATTER_AT..SCATTER_AT + 1, SCATTER_AT + 1..BETWEEN_AT];
/// Strengths that are changed together, in this order. Excess of moves comes first: a bias scatter that explains one
/// bad move would absorb the poses. The axes of a gyro scatter alike more often than not.
const DIRECTIONS: [Range<usize>; N_STRENGTHS + 1] = [
    EXCESS_AT..EXCESS_AT + 1,
    EXCESS_AT + 1..N_STRENGTHS,
    0..1,
    1..2,
    SCATTER_AT..SCATTER_AT + 1,
    SCATTER_AT + 1..BETWEEN_AT,
    SCATTER_AT + 1..SCATTER_AT + 2,
    SCATTER_AT + 2..SCATTER_AT + 3,
    SCATTER_AT + 3..SCATTER_AT + 4,
    BETWEEN_AT..BETWEEN_AT + 1,
    BETWEEN_AT + 1..EXCESS_AT,
];
/// Number of these that are of the moves' own strengths.
const OF_MOVES: usize = 2;
type Point = [f64; N_STRENGTHS];
/// Natural logarithms between which each kind is searched. No bound on noise is physical; these end the search: a walk
/// that equals white noise after 0.2 s, scatter of thousands of errors of a pose, rows thousands of errors off, or a
/// hundredth of the motion faster than the samples.
const CORNER: (f64, f64) = (-1.6, 8.5);
const SCATTER: (f64, f64) = (-6.9, 9.2);
/// A jump at an unknown instant departs from the line by √(1/12) of a jump of √2 (0.4), one at either end of the move
/// by √2/2 (0.7), a third bias by √(3/2): no departure is larger.
const BETWEEN: (f64, f64) = (-3.0, 0.2);
const EXCESS: (f64, f64) = (-4.6, 9.2);
/// Standard deviation of the logarithm of an excess: the motion faster than the samples is extrapolated, to a factor of
/// three.
pub(super) const EXTRAPOLATED: f64 = 1.1;
/// Rows with this excess have no weight, and keep none: a search leaves it as given.
const NO_WEIGHT: f64 = 6.9;
/// Scatter at which a search from nothing begins: near nothing the evidence is flat.
const FROM_NOTHING: [f64; 2] = [1.0, 6.0];
/// Corner time and scatter by which a walk and a scatter are exchanged for one another: a drifting bias may be either,
/// and the evidence has an optimum at both.
const EXCHANGED: [(f64, f64); 4] = [
    (600.0, 3.0),
    (600.0, 10.0),
    (3.0, NO_SCATTER),
    (0.6, NO_SCATTER),
];
/// Scatter below which the departure of biases between poses has no effect.
const LEAST_SCATTER: f64 = 0.2;
/// A pass over all strengths that gains less than this ends the search.
const ENOUGH: f64 = 0.1;
const MOST_PASSES: usize = 8;
/// Steps, of the logarithm, at which the search along one strength begins and ends.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.1;
/// Changes smaller than this change the evidence by less than a hundredth.
const LEAST_MOVE: f64 = 0.02;

/// Bounds of some strengths, for the hypothesis that they are no larger than noise alone makes them.
#[derive(Debug, Clone, Copy)]
pub struct Within {
    /// Shortest corner times, s.
    pub corner_s: [f64; 2],
    /// Largest scatter, in units of the session's reference.
    pub scatter: [f64; 2],
    /// Largest excess of moves.
    pub excess: [f64; 2],
}

impl Within {
    /// No bounds.
    pub const ANYTHING: Self = Self {
        corner_s: [0.0; 2],
        scatter: [f64::INFINITY; 2],
        excess: [f64::INFINITY; 2],
    };

    fn bounds(&self) -> [(f64, f64); N_STRENGTHS] {
        let below = |most: f64, (low, high): (f64, f64)| (low, most.ln().clamp(low, high));
        std::array::from_fn(|i| match i {
            0 | 1 => (self.corner_s[i].ln().clamp(CORNER.0, CORNER.1), CORNER.1),
            SCATTER_AT => below(self.scatter[0], SCATTER),
            _ if i < BETWEEN_AT => below(self.scatter[1], SCATTER),
            _ if i < EXCESS_AT => BETWEEN,
            _ => below(self.excess[i - EXCESS_AT], EXCESS),
        })
    }
}

/// A search along one strength after the other, in logarithms.
pub(super) struct Search<'a> {
    hypothesis: &'a Hypothesis,
    bounds: [(f64, f64); N_STRENGTHS],
    x: Point,
    value: f64,
    /// The rows outside the bias processes at the strengths evaluated last, and those strengths.
    weighted_rows: Option<([u64; N_STRENGTHS - SCATTER_AT], Weighed)>,
}

impl<'a> Search<'a> {
    pub(super) fn new(hypothesis: &'a Hypothesis, start: &Strengths, within: &Within) -> Self {
        let mut x = [0.0; N_STRENGTHS];
        x[..SCATTER_AT].copy_from_slice(&start.corner_s);
        x[SCATTER_AT..BETWEEN_AT].copy_from_slice(&start.scatter);
        x[BETWEEN_AT..EXCESS_AT].copy_from_slice(&start.between);
        x[EXCESS_AT..].copy_from_slice(&start.excess);
        let mut x = x.map(f64::ln);
        let bounds = within.bounds();
        for (value, (low, high)) in x.iter_mut().zip(bounds) {
            *value = value.clamp(low, high);
        }
        let mut search = Self {
            hypothesis,
            bounds,
            x,
            value: 0.0,
            weighted_rows: None,
        };
        search.value = search.at(&x);
        search
    }

    pub(super) fn strengths(&self) -> Strengths {
        strengths_of(&self.x)
    }

    pub(super) fn value(&self) -> f64 {
        self.value
    }

    fn at(&mut self, x: &Point) -> f64 {
        let strengths = strengths_of(x);
        let key = std::array::from_fn(|i| x[SCATTER_AT + i].to_bits());
        if self
            .weighted_rows
            .as_ref()
            .is_none_or(|(known, _)| *known != key)
        {
            let Some(weighted_rows) = self.hypothesis.weighted_rows(&strengths) else {
                return f64::NEG_INFINITY;
            };
            self.weighted_rows = Some((key, weighted_rows));
        }
        let Some((_, weighted_rows)) = &self.weighted_rows else {
            return f64::NEG_INFINITY;
        };
        let away = x[EXCESS_AT..].iter().map(|e| e.powi(2));
        self.hypothesis.beside(&strengths, weighted_rows)
            - 0.5 * away.sum::<f64>() / EXTRAPOLATED.powi(2)
    }

    fn is_free(&self, i: usize) -> bool {
        let h = self.hypothesis;
        let has_moves = !h.moves.is_empty();
        match i {
            _ if i < BETWEEN_AT => h.process[i].n > 0 && self.bounds[i].0 < self.bounds[i].1,
            _ if i < EXCESS_AT => {
                let mut scatters = self.x[SCATTER_OF[i - BETWEEN_AT].clone()].iter();
                has_moves && scatters.any(|x| *x > LEAST_SCATTER.ln())
            }
            _ => has_moves && self.bounds[i].0 < self.bounds[i].1 && self.x[i] < NO_WEIGHT,
        }
    }

    /// Passes over all directions until one gains nothing. Unless it is the first search, weights of moves alone were
    /// renewed: where their own strengths gain nothing by that, the others do not.
    pub(super) fn run(&mut self, is_first: bool) {
        let mut step = [FIRST_STEP; DIRECTIONS.len()];
        for pass in 0..MOST_PASSES {
            let before = self.value;
            for (k, (direction, step)) in DIRECTIONS.iter().zip(&mut step).enumerate() {
                if k == OF_MOVES && pass == 0 && !is_first && self.value - before < ENOUGH {
                    return;
                }
                // Axes are changed one by one once they have been changed together.
                let is_one_axis = direction.start == SCATTER_AT + 1 && direction.len() == 1;
                if self.is_free(direction.start) && !(is_one_axis && pass == 0) {
                    self.along(direction, step);
                }
            }
            if pass == 0 && is_first {
                self.exchange();
            }
            if self.value - before < ENOUGH {
                break;
            }
        }
    }

    /// Tries a walk in place of a scatter, and a scatter in place of a walk, for either sensor.
    fn exchange(&mut self) {
        for sensor in 0..2 {
            let scatters = SCATTER_OF[sensor].clone();
            if !(self.is_free(sensor) && self.is_free(scatters.start)) {
                continue;
            }
            for (corner, scatter) in EXCHANGED {
                let mut x = self.x;
                x[sensor] = corner.ln();
                x[scatters.clone()].fill(scatter.ln());
                for (value, (low, high)) in x.iter_mut().zip(self.bounds) {
                    *value = value.clamp(low, high);
                }
                let value = self.at(&x);
                if value > self.value {
                    (self.x, self.value) = (x, value);
                }
            }
        }
    }

    /// The strengths of a direction changed by a factor, none beyond its bounds.
    fn moved(&self, direction: &Range<usize>, by: f64) -> Point {
        let mut x = self.x;
        for i in direction.clone() {
            x[i] = (x[i] + by).clamp(self.bounds[i].0, self.bounds[i].1);
        }
        x
    }

    fn take(&mut self, x: Point) -> bool {
        let value = self.at(&x);
        let is_better = value > self.value;
        if is_better {
            (self.x, self.value) = (x, value);
        }
        is_better
    }

    /// Whether strengths are so small that the evidence is flat there.
    fn is_nothing(&self, direction: &Range<usize>) -> bool {
        let is_scatter = (SCATTER_AT..BETWEEN_AT).contains(&direction.start);
        is_scatter
            && self.x[direction.clone()]
                .iter()
                .all(|x| *x < LEAST_SCATTER.ln())
    }

    /// Whether a step from nothing gains.
    fn rises(&mut self, direction: &Range<usize>) -> bool {
        for value in FROM_NOTHING {
            let mut x = self.x;
            x[direction.clone()].fill(value.ln().min(self.bounds[direction.start].1));
            self.take(x);
        }
        !self.is_nothing(direction)
    }

    /// A step either way, doubled while it gains; otherwise the maximum of a parabola.
    fn along(&mut self, direction: &Range<usize>, step: &mut f64) {
        if self.is_nothing(direction) && !self.rises(direction) {
            return;
        }
        let (here, i) = (self.x, direction.start);
        let (down, up) = (self.moved(direction, -*step), self.moved(direction, *step));
        let mut value_of = |x: &Point| {
            if x.map(f64::to_bits) == here.map(f64::to_bits) {
                f64::NEG_INFINITY
            } else {
                self.at(x)
            }
        };
        let (below, above) = (value_of(&down), value_of(&up));
        if below.max(above) > self.value {
            let sign = if above > below { 1.0 } else { -1.0 };
            (self.x, self.value) = if above > below {
                (up, above)
            } else {
                (down, below)
            };
            let mut stride = *step;
            loop {
                stride *= 2.0;
                let next = self.moved(direction, sign * stride);
                if (next[i] - self.x[i]).abs() < LAST_STEP || !self.take(next) {
                    return;
                }
            }
        }
        let (a, b) = (here[i] - down[i], up[i] - here[i]);
        // A parabola through three points.
        let (p, q) = ((below - self.value) / a, (above - self.value) / b);
        let bend = (p + q) / (a + b);
        if bend < 0.0 && bend.is_finite() {
            let by = (-(q * a - p * b) / (a + b) / (2.0 * bend)).clamp(-a, b);
            if by.abs() > LEAST_MOVE {
                self.take(self.moved(direction, by));
            }
        }
        *step = (*step * 0.5).max(LAST_STEP);
    }
}

fn strengths_of(x: &Point) -> Strengths {
    let e = x.map(f64::exp);
    let pair = |at: usize| [e[at], e[at + 1]];
    Strengths {
        corner_s: pair(0),
        scatter: std::array::from_fn(|i| e[SCATTER_AT + i].max(NO_SCATTER)),
        between: pair(BETWEEN_AT),
        excess: pair(EXCESS_AT),
    }
}
