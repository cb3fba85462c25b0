//! RRPR, SLIDERCRANK, FOURBAR: one plane loop of four joints, any of them independent.

use nalgebra::{Matrix3, Vector3};

use crate::closure::{Closure, LoopJoint, Planar, Rrpr, TwoLinks};
use crate::compile::closed_forms::loops::{
    Ring, pin_in_plane, reversed, ring, senses, starting_at,
};
use crate::compile::closed_forms::{Deviation, Form, Reading, sign};
use crate::compile::geometry::onto_z;
use crate::mechanism::Cut;
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// Shortest link and least sine between links at zero, relative to the mechanism's size.
pub(super) const DEGENERATE: f64 = 1e-6;

/// Deviation of the links from one line at a change point, relative to the mechanism's size; files
/// are rounded.
const CHANGE: f64 = 1e-6;

/// Message that refuses a loop with a change point.
const MEETS: &str = "links can stand in one line where two assemblies meet, a change point";

pub(super) type Plane = [Dd; 2];

/// True for a loop whose links can only just align.
pub(super) fn has_change_point(of: &Reading<'_>) -> bool {
    [false, true].into_iter().any(|slider| read(of, slider).is_err_and(|why| why == MEETS))
}

/// The loop, with one slider or none.
pub(super) fn read(of: &Reading<'_>, slider: bool) -> Result<Form, String> {
    let cluster = of.cluster;
    let ([cut], [y], 3, true) =
        (&cluster.cuts[..], &cluster.independent[..], cluster.n, of.is_simple())
    else {
        return Err("joints are not the three of one loop, one of them independent".into());
    };
    let mut deviations = Vec::new();
    let InPlane { ring, sense, axes } = in_plane(of, cut, *y, slider, &mut deviations)?;
    let plane = |v: &Vector3<Dd>| -> Plane { [axes.col(0).dot(*v), axes.col(1).dot(*v)] };
    let origin = if ring[0].slides { ring[1].point } else { ring[0].point };
    let [a, p2, d] = [1, 2, 3].map(|k: usize| plane(&(ring[k].point - origin)));
    let along = |x: &Ring| normalised(plane(&x.axis)).ok_or("slider is perpendicular to the plane");

    let closure = match ring.iter().position(|x| x.slides) {
        Some(2) => Closure::Rrpr(lambda(of, &ring, &sense, a, d, along(&ring[2])?)?),
        place => {
            let b = minus(&p2, &a);
            let c = minus(&p2, &d);
            let t = place.map_or(Ok([Dd::ZERO; 2]), |k| along(&ring[k]))?;
            // the way of an independent slider counts in its direction
            let t = if place == Some(0) { t.map(|x| x * sense[0]) } else { t };
            let has_bearing = place == Some(3);
            let (turned, least) = if has_bearing {
                (inner(&t, &b), size(&b))
            } else {
                (outer(&b, &c), size(&b) * size(&c))
            };
            let short = DEGENERATE * cluster.length;
            if size(&b) < short
                || !has_bearing && size(&c) < short
                || turned.abs().to_f64() <= DEGENERATE * least
            {
                return Err("links stand in line or have no length at zero".into());
            }
            let reach = if has_bearing {
                // offset of J1 from the slider's line, against b
                let normal = [-t[1], t[0]];
                let middle = (inner(&normal, &b) + inner(&normal, &a)).to_f64();
                [(middle + size(&a)).abs() - size(&b), (middle - size(&a)).abs() - size(&b)]
            } else if place == Some(0) {
                // |D| of an independent slider, against b − c
                let nearest = outer(&t, &minus(&d, &a)).abs().to_f64();
                [nearest - (size(&b) - size(&c)).abs(), f64::INFINITY]
            } else {
                // |D| against b − c and b + c
                let near = (size(&a) - size(&d)).abs();
                let far = size(&a) + size(&d);
                [near - (size(&b) - size(&c)).abs(), far - (size(&b) + size(&c))]
            };
            has_no_change_point(reach, cluster.length)?;
            let tie = |k: usize| {
                ring[k].joint.map(|joint| LoopJoint { joint, place: k, sense: sense[k] })
            };
            let ties: Vec<LoopJoint<Dd>> = (1..4).filter_map(tie).collect();
            let others = ties.try_into().map_err(|_| "loop is cut twice")?;
            Closure::Planar(Planar {
                joint: *y,
                slides: place == Some(0),
                a,
                d,
                t,
                links: two_links(b, c, sign(turned)),
                slider: has_bearing,
                others,
                polish: None,
            })
        }
    };
    Ok(Form { closure, deviations })
}

/// A plane loop of four joints from its independent one on.
struct InPlane {
    ring: Vec<Ring>,
    sense: Vec<Dd>,
    /// Its plane's axes and normal {cluster's parent body}.
    axes: Matrix3<Dd>,
}

/// The loop of a cut from one of its joints on, with one slider or none.
fn in_plane(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    y: usize,
    slider: bool,
    deviations: &mut Vec<Deviation>,
) -> Result<InPlane, String> {
    let mut ring = starting_at(ring(of, cut), y)?;
    if ring.len() != 4 || ring.iter().filter(|x| x.slides).count() != usize::from(slider) {
        return Err(format!(
            "loop is not one of {}",
            if slider { "two turns, a slider and a pin" } else { "three turns and a pin" }
        ));
    }
    // a slider beside the independent joint comes last, a pin beside it comes first if the slider
    // lies opposite
    if ring[1].slides || ring[2].slides && ring[3].joint.is_none() {
        ring = reversed(&ring);
    }

    // the plane: n along the first turning axis, so that the independent joint's sense is +1
    let Some(first) = ring.iter().find(|x| !x.slides && x.joint.is_some()) else {
        return Err("loop has no axis".into());
    };
    let n = first.axis.map(|x| x * first.direction);
    let sense = senses(&ring, &n, deviations);
    pin_in_plane(of, cut, &n, deviations)?;
    Ok(InPlane { axes: onto_z(&n), ring, sense })
}

/// True where a joint is in the loop of a cut.
pub(super) fn has(of: &Reading<'_>, cut: &Cut<Dd>, joint: usize) -> bool {
    ring(of, cut).iter().any(|x| x.joint == Some(joint))
}

/// The loop of a cut as a lambda whose rocker is this joint, which something else moves.
pub(super) fn driving(
    of: &Reading<'_>,
    cut: &Cut<Dd>,
    rocker: usize,
    deviations: &mut Vec<Deviation>,
) -> Result<Rrpr<Dd>, String> {
    let InPlane { ring, sense, axes } = in_plane(of, cut, rocker, true, deviations)?;
    if !ring[2].slides {
        return Err("slider is not opposite to the crank that it drives".into());
    }
    let plane = |v: &Vector3<Dd>| -> Plane { [axes.col(0).dot(*v), axes.col(1).dot(*v)] };
    let [d3, d1] = [1, 3].map(|k: usize| plane(&(ring[k].point - ring[0].point)));
    let t = normalised(plane(&ring[2].axis)).ok_or("slider is perpendicular to the plane")?;
    lambda(of, &ring, &sense, d3, d1, t)
}

/// At the ends of the independent joint's range the links must not just stand in one line: two
/// assemblies meet there, each goes on as the other, and a closed form knows no path.
fn has_no_change_point(reach: [f64; 2], length: f64) -> Result<(), String> {
    if reach.iter().any(|x| x.abs() < CHANGE * length) {
        return Err(MEETS.into());
    }
    Ok(())
}

/// A slider that lies opposite to the independent joint: rocker, pin, slider, stator.
fn lambda(
    of: &Reading<'_>,
    ring: &[Ring],
    sense: &[Dd],
    d3: Plane,
    d1: Plane,
    t: Plane,
) -> Result<Rrpr<Dd>, String> {
    let (Some(rocker), Some(slider), Some(stator)) = (ring[0].joint, ring[2].joint, ring[3].joint)
    else {
        return Err("pin is not beside the rocker".into());
    };
    // the length grows as the slider's coordinate does
    let t0 = t.map(|x| -(x * ring[2].direction));
    let d = minus(&d3, &d1);
    let length0 = inner(&d, &t0);
    let eccentricity = outer(&t0, &d);
    if length0.abs().to_f64() < DEGENERATE * of.cluster.length {
        return Err("slider has no length at zero".into());
    }
    if size(&d3) < DEGENERATE * of.cluster.length {
        return Err("pin lies on the rocker's axis".into());
    }
    let nearest = (size(&d3) - size(&d1)).abs();
    has_no_change_point([nearest - eccentricity.abs().to_f64(), f64::INFINITY], of.cluster.length)?;
    Ok(Rrpr {
        joints: [rocker, stator, slider],
        d3,
        d1,
        t0,
        square0: inner(&d, &d),
        length0,
        eccentricity,
        sense: -sense[3],
        side: sign(length0),
        polish: None,
    })
}

/// Links that meet in a pin, on a side.
pub(super) fn two_links(b: Plane, c: Plane, side: Dd) -> TwoLinks<Dd> {
    TwoLinks { b, c, b_square: inner(&b, &b), c_square: inner(&c, &c), side }
}

pub(super) fn minus(x: &Plane, y: &Plane) -> Plane {
    [x[0] - y[0], x[1] - y[1]]
}

pub(super) fn inner(x: &Plane, y: &Plane) -> Dd {
    x[0] * y[0] + x[1] * y[1]
}

pub(super) fn outer(x: &Plane, y: &Plane) -> Dd {
    x[0] * y[1] - x[1] * y[0]
}

pub(super) fn size(x: &Plane) -> f64 {
    inner(x, x).to_f64().sqrt()
}

fn normalised(x: Plane) -> Option<Plane> {
    let length = inner(&x, &x).sqrt();
    (length > Dd::ZERO).then(|| x.map(|x| x / length))
}
