//! PARALLELOGRAMCHAIN from loops: every loop is a parallelogram with parallel opposite links, so q
//! is linear in y.

use crate::closure::Closure;
use crate::compile::closed_forms::loops::{pin_in_plane, ring, senses};
use crate::compile::closed_forms::{Form, Reading};
use crate::compile::couplings::{Relation, solve};
use crate::compile::geometry::norm;
use crate::scalar::{Dd, Real, Triple};

/// Two relations of each loop, and the couplings.
pub(super) fn read(of: &Reading<'_>) -> Result<Form, String> {
    let cluster = of.cluster;
    if !of.is_simple() {
        return Err("joints are not of one freedom each".into());
    }
    let mut relations = Vec::new();
    let mut deviations = Vec::new();
    for cut in &cluster.cuts {
        if let [row] = &cut.rows[..]
            && cut.is_coupling()
        {
            relations.push(Relation::of(row));
            continue;
        }
        let mut ring = ring(of, cut);
        if ring.len() != 4 || ring.iter().any(|x| x.slides) {
            return Err("loop is not one of three turns and a pin".into());
        }
        // the pin last
        let at = ring.iter().position(|x| x.joint.is_none()).unwrap_or(0);
        ring.rotate_left((at + 1) % 4);
        let n = ring[0].axis;
        let sense = senses(&ring, &n, &mut deviations);
        pin_in_plane(of, cut, &n, &mut deviations)?;

        // opposite sides are equal as vectors, seen in the plane
        let side = |a: usize, b: usize| ring[b].point - ring[a].point;
        let apart = side(0, 1) - side(3, 2);
        let in_plane = apart.add_scaled(n, -n.dot(apart));
        let sides = [side(0, 1), side(1, 2)].map(|x| norm(&x).to_f64());
        let off = norm(&in_plane).to_f64() / f64::max(sides[0], sides[1]);
        deviations.push(("a loop that is no parallelogram: opposite sides differ", None, off));

        // the links on both sides of two joints that follow one another turn as one
        for k in [0, 1] {
            let terms =
                [k, k + 1].into_iter().filter_map(|k| Some((ring[k].joint?, sense[k]))).collect();
            relations.push(Relation { terms, curves: Vec::new(), offset: Dd::from(0.0) });
        }
    }
    let coupling =
        solve(cluster, &relations).ok_or("parallelograms do not determine the dependent joints")?;
    Ok(Form { closure: Closure::Coupling(coupling), deviations })
}
