//! The motion of a robot and the forces of its actuators.

use sarrus_dynamics::Model;

use crate::dense::Triangle;
use crate::{IdentifyError, Outcome};

/// Places on each side of one through which a cubic goes that tells its rates.
const BESIDE: usize = 7;

/// One state and the forces that were measured at it.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Independent coordinates (n_qy).
    pub y: Vec<f64>,
    /// Their velocities and accelerations (n_vy).
    pub yd: Vec<f64>,
    /// See `yd`.
    pub ydd: Vec<f64>,
    /// Forces of the actuators (n_u).
    pub tau_u: Vec<f64>,
}

/// Samples of a motion, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// The samples.
    pub samples: Vec<Sample>,
}

impl Log {
    /// From a table with the columns that `sarrus time` writes: `t`, each independent coordinate
    /// by its name, its velocity as NAME/yd, its acceleration as NAME/ydd, and the force of each
    /// actuator as NAME/tau_u. Without accelerations, or without velocities, all columns are taken
    /// from cubics through fifteen rows each.
    ///
    /// # Errors
    ///
    /// Names the column that is missing.
    pub fn of_table(model: &Model<f64>, heads: &[String], rows: &[Vec<f64>]) -> Outcome<Log> {
        let column = |name: &String| heads.iter().position(|head| head == name);
        let find = |names: &[String], ending: &str| -> Outcome<Vec<usize>> {
            let of = |name: &String| {
                let name = format!("{name}{ending}");
                let missing = || format!("found no column `{name}` among {}", heads.join(", "));
                column(&name).ok_or_else(|| IdentifyError::Log(missing()))
            };
            names.iter().map(of).collect()
        };
        let pick = |columns: &[usize]| -> Vec<Vec<f64>> {
            rows.iter().map(|row| columns.iter().map(|k| row[*k]).collect()).collect()
        };
        let of_y = pick(&find(model.independent_q_names(), "")?);
        let of_tau = pick(&find(model.active_names(), "/tau_u")?);
        let names = model.independent_names();
        let measured = find(names, "/yd").and_then(|yd| Ok([yd, find(names, "/ydd")?]));
        let [y, yd, ydd, tau] = match measured {
            Ok([yd, ydd]) => [of_y, pick(&yd), pick(&ydd), of_tau],
            Err(missing) => {
                let times = column(&"t".to_owned()).filter(|_| model.sizes().n_qy == names.len());
                let Some(t) = times else { return Err(missing) };
                let t: Vec<f64> = rows.iter().map(|row| row[t]).collect();
                let [y, yd, ydd] = smoothed(&t, &of_y)?;
                let [tau, ..] = smoothed(&t, &of_tau)?;
                [y, yd, ydd, tau]
            }
        };
        let samples = y.into_iter().zip(yd).zip(ydd).zip(tau);
        let samples = samples.map(|(((y, yd), ydd), tau_u)| Sample { y, yd, ydd, tau_u });
        Ok(Log { samples: samples.collect() })
    }
}

/// Values, first and second derivatives of cubics through the rows around each row, without those
/// at the ends.
fn smoothed(t: &[f64], rows: &[Vec<f64>]) -> Outcome<[Vec<Vec<f64>>; 3]> {
    let mut found = [const { Vec::new() }; 3];
    for k in BESIDE..rows.len().saturating_sub(BESIDE) {
        let window = k - BESIDE..k + BESIDE + 1;
        let span = t[k + BESIDE] - t[k - BESIDE];
        let rises = t[window.clone()].windows(2).all(|pair| pair[0] < pair[1]);
        if !rises {
            return Err(IdentifyError::Log(format!("the times around row {k} do not increase")));
        }
        let n = rows[k].len();
        let mut values = [const { Vec::new() }; 3];
        let mut cubic = Triangle::new(4 + n);
        for i in window {
            let s = (t[i] - t[k]) / span;
            cubic.add(&mut [&[1.0, s, s * s, s * s * s], &rows[i][..]].concat());
        }
        for j in 0..n {
            let mut x = [0, 1, 2, 3].map(|i| cubic.row(i)[4 + j]);
            cubic.solve(&mut x);
            let per_time = [1.0, 1.0 / span, 2.0 / (span * span)];
            (0..3).for_each(|d| values[d].push(x[d] * per_time[d]));
        }
        found.iter_mut().zip(values).for_each(|(found, values)| found.push(values));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_a_smooth_motion_are_those_of_its_cubics() {
        let t: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let rows: Vec<Vec<f64>> = t.iter().map(|t| vec![t.sin(), 1.0 + t * t * t]).collect();
        let [y, yd, ydd] = smoothed(&t, &rows).unwrap();
        assert_eq!(y.len(), 86);
        for (k, t) in t[BESIDE..93].iter().enumerate() {
            assert!((y[k][0] - t.sin()).abs() < 1e-6 && (yd[k][0] - t.cos()).abs() < 1e-5);
            assert!((ydd[k][1] - 6.0 * t).abs() < 1e-9);
        }
    }
}
