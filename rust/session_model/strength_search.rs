//! The strengths of noise that make a hypothesis likeliest: a search along one after the other, in logarithms
//! (docs/model-session.md, 11.18).

use super::Strengths;
use super::evidence::Part;
use super::hypothesis::Hypothesis;
use super::strengths::NO_SCATTER;

/// Number of strengths: corner time, scatter, straying between poses of either sensor, excess of both kinds of rows.
const N_STRENGTHS: usize = 8;
/// Natural logarithms between which each kind is sought. No bound on noise is physical: these only end the search, a
/// walk that meets white noise in a fifth of a second, scatter of thousands of errors of a pose, rows thousands of times off.
const CORNER: (f64, f64) = (-1.6, 8.5);
const SCATTER: (f64, f64) = (-6.9, 9.2);
const BETWEEN: (f64, f64) = (-3.0, 1.6);
const EXCESS: (f64, f64) = (0.0, 9.2);
/// Scatter, and excess of moves, that are sought from nothing begin at these: near nothing the evidence is flat.
const FROM_NOTHING: [f64; 2] = [1.0, 6.0];
/// What a walk and a scatter are exchanged for one another by: a bias that wanders may be either, and the evidence has an
/// optimum at both.
const EXCHANGED: [(f64, f64); 4] = [
    (600.0, 3.0),
    (600.0, 10.0),
    (3.0, NO_SCATTER),
    (0.6, NO_SCATTER),
];
/// Scatter below which how far zeros stray between poses shows nowhere.
const LEAST_SCATTER: f64 = 0.2;
/// A pass over all strengths that gains less than this ends the search.
const ENOUGH: f64 = 0.1;
const MOST_PASSES: usize = 8;
/// Steps, of the logarithm, at which the search along one strength begins and ends.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.1;

/// Bounds of some strengths, where a hypothesis says that they are no larger than noise alone makes them.
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
    /// None.
    pub const ANYTHING: Self = Self {
        corner_s: [0.0; 2],
        scatter: [f64::INFINITY; 2],
        excess: [f64::INFINITY; 2],
    };

    fn bounds(&self) -> [(f64, f64); N_STRENGTHS] {
        let kinds = [CORNER, SCATTER, BETWEEN, EXCESS];
        std::array::from_fn(|i| {
            let ((low, high), k) = (kinds[i / 2], i % 2);
            match i / 2 {
                0 => (self.corner_s[k].ln().clamp(low, high), high),
                1 => (low, self.scatter[k].ln().clamp(low, high)),
                3 => (low, self.excess[k].ln().clamp(low, high)),
                _ => (low, high),
            }
        })
    }
}

/// A search along one strength after the other, in logarithms.
pub(super) struct Search<'a> {
    hypothesis: &'a Hypothesis,
    bounds: [(f64, f64); N_STRENGTHS],
    x: [f64; N_STRENGTHS],
    value: f64,
    /// The rows of moves as they were weighed last, and for what.
    heard: Option<([u64; 6], (Part, f64))>,
}

impl<'a> Search<'a> {
    pub(super) fn new(hypothesis: &'a Hypothesis, start: &Strengths, within: &Within) -> Self {
        let s = start;
        let x = [
            s.corner_s[0],
            s.corner_s[1],
            s.scatter[0],
            s.scatter[1],
            s.between[0],
            s.between[1],
            s.excess[0],
            s.excess[1],
        ];
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
            heard: None,
        };
        search.value = search.at(&x);
        search
    }

    pub(super) fn strengths(&self) -> Strengths {
        strengths_of(&self.x)
    }

    fn at(&mut self, x: &[f64; N_STRENGTHS]) -> f64 {
        let strengths = strengths_of(x);
        let key = [x[2], x[3], x[4], x[5], x[6], x[7]].map(f64::to_bits);
        if self.heard.as_ref().is_none_or(|(known, _)| *known != key) {
            let Some(heard) = self.hypothesis.heard(&strengths) else {
                return f64::NEG_INFINITY;
            };
            self.heard = Some((key, heard));
        }
        let Some((_, heard)) = &self.heard else {
            return f64::NEG_INFINITY;
        };
        self.hypothesis.beside(&strengths, heard)
    }

    fn is_free(&self, i: usize) -> bool {
        let h = self.hypothesis;
        let has_moves = !h.moves.is_empty();
        match i {
            0 => h.process[0].n > 0,
            1 => h.has_rate && h.process[1].n > 0,
            2 => h.process[2].n > 0,
            3 => h.has_rate && h.process[3].n > 0,
            4 | 5 => has_moves && self.x[i - 2] > LEAST_SCATTER.ln(),
            _ => has_moves,
        }
    }

    pub(super) fn run(&mut self) {
        let mut step = [FIRST_STEP; N_STRENGTHS];
        for pass in 0..MOST_PASSES {
            let before = self.value;
            for i in 0..N_STRENGTHS {
                if self.is_free(i) {
                    self.along(i, &mut step[i]);
                }
            }
            if pass == 0 {
                self.exchange();
            }
            if self.value - before < ENOUGH {
                break;
            }
        }
    }

    /// Tries a walk for a scatter, and a scatter for a walk, of either sensor.
    fn exchange(&mut self) {
        for sensor in 0..2 {
            if !(self.is_free(sensor) && self.is_free(sensor + 2)) {
                continue;
            }
            for (corner, scatter) in EXCHANGED {
                let mut x = self.x;
                for (i, value) in [(sensor, corner.ln()), (sensor + 2, scatter.ln())] {
                    x[i] = value.clamp(self.bounds[i].0, self.bounds[i].1);
                }
                let value = self.at(&x);
                if value > self.value {
                    (self.x, self.value) = (x, value);
                }
            }
        }
    }

    fn tried(&mut self, i: usize, value: f64) -> f64 {
        let mut x = self.x;
        x[i] = value;
        self.at(&x)
    }

    /// A step either way, doubled while it gains; then where a parabola is highest.
    fn along(&mut self, i: usize, step: &mut f64) {
        let (low, high) = self.bounds[i];
        let nothing = if i < 4 { LEAST_SCATTER.ln() } else { LAST_STEP };
        if matches!(i, 2 | 3 | 6 | 7) && self.x[i] < nothing {
            for value in FROM_NOTHING {
                if value.ln() > low && value.ln() < high {
                    self.take(i, value.ln());
                }
            }
            if self.x[i] < LEAST_SCATTER.ln() {
                *step *= 0.5;
                return;
            }
        }
        let here = self.x[i];
        let (down, up) = ((here - *step).max(low), (here + *step).min(high));
        let (below, above) = (
            if down < here {
                self.tried(i, down)
            } else {
                f64::NEG_INFINITY
            },
            if up > here {
                self.tried(i, up)
            } else {
                f64::NEG_INFINITY
            },
        );
        if below.max(above) > self.value {
            let sign = if above > below { 1.0 } else { -1.0 };
            let (mut to, mut value) = if above > below {
                (up, above)
            } else {
                (down, below)
            };
            let mut stride = *step;
            loop {
                stride *= 2.0;
                let next = (to + sign * stride).clamp(low, high);
                if (next - to).abs() < LAST_STEP {
                    break;
                }
                let further = self.tried(i, next);
                if further <= value {
                    break;
                }
                (to, value) = (next, further);
            }
            (self.x[i], self.value) = (to, value);
        } else {
            if down < here && up > here {
                let (a, b) = (here - down, up - here);
                // A parabola through three points.
                let (p, q) = ((below - self.value) / a, (above - self.value) / b);
                let bend = (p + q) / (a + b);
                if bend < 0.0 && bend.is_finite() {
                    let slope = (q * a - p * b) / (a + b);
                    let to = (here - slope / (2.0 * bend)).clamp(down, up);
                    if (to - here).abs() > 0.02 {
                        self.take(i, to);
                    }
                }
            }
            *step = (*step * 0.5).max(LAST_STEP);
        }
    }

    fn take(&mut self, i: usize, value: f64) {
        let found = self.tried(i, value);
        if found > self.value {
            (self.x[i], self.value) = (value, found);
        }
    }
}

fn strengths_of(x: &[f64; N_STRENGTHS]) -> Strengths {
    let e = x.map(f64::exp);
    Strengths {
        corner_s: [e[0], e[1]],
        scatter: [e[2].max(NO_SCATTER), e[3].max(NO_SCATTER)],
        between: [e[4], e[5]],
        excess: [e[6], e[7]],
    }
}
