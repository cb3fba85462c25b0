//! Triangles of STL and OBJ files, their convex hull, and both as text of a page.

use std::collections::HashMap;
use std::path::Path;

use sarrus_models::triangles::{Triangle, binary_stl, obj};
use serde_json::{Value, json};

/// Steps of a side of a mesh, and of a hull: a hull has few triangles where its steps are coarse.
const FINE: f64 = 65_535.0;
const COARSE: f64 = 511.0;

/// A mesh as it was read: the corners of one triangle after the other.
pub(crate) struct Mesh(Vec<[f64; 3]>);

/// Points in steps from a corner, and triangles of their numbers.
pub(crate) struct Packed {
    low: [f64; 3],
    step: [f64; 3],
    points: Vec<[i64; 3]>,
    triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// Reads a file by its ending.
    pub(crate) fn read(path: &Path) -> Result<Mesh, String> {
        let bytes = std::fs::read(path).map_err(|error| format!("cannot be read: {error}"))?;
        let corners = |of: Option<Vec<Triangle>>| of.map(|triangles| triangles.concat());
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let corners = match ending.as_ref().and_then(|ending| ending.to_str()) {
            Some("stl") => corners(binary_stl(&bytes)).or_else(|| text_stl(&bytes)),
            Some("obj") => corners(obj(&bytes)),
            _ => return Err("is neither STL nor OBJ".to_owned()),
        };
        let is_right = |corners: &Vec<[f64; 3]>| {
            corners.len() >= 3 && corners.iter().flatten().all(|x| x.is_finite())
        };
        corners.filter(is_right).map(Mesh).ok_or_else(|| "has no triangles".to_owned())
    }

    /// The least and the largest coordinates.
    pub(crate) fn bounds(&self) -> [[f64; 3]; 2] {
        let fold = |of: fn(f64, f64) -> f64, from: f64| {
            self.0.iter().fold([from; 3], |most, p| [0, 1, 2].map(|k| of(most[k], p[k])))
        };
        [fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY)]
    }

    pub(crate) fn packed(&self) -> Packed {
        self.in_steps(FINE)
    }

    /// Points of a grid; triangles that shrink to lines are left out.
    fn in_steps(&self, steps: f64) -> Packed {
        let [low, high] = self.bounds();
        let step = [0, 1, 2].map(|k| ((high[k] - low[k]) / steps).max(f64::MIN_POSITIVE));
        let mut points = Vec::new();
        let mut known = HashMap::new();
        let mut number = |p: &[f64; 3]| {
            let at = [0, 1, 2].map(|k| ((p[k] - low[k]) / step[k]).round() as i64);
            *known.entry(at).or_insert_with(|| {
                points.push(at);
                points.len() - 1
            })
        };
        let mut triangles: Vec<[usize; 3]> = Vec::new();
        for [a, b, c] in self.0.as_chunks::<3>().0 {
            triangles.push([number(a), number(b), number(c)]);
        }
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        Packed { low, step, points, triangles }
    }

    /// The convex hull of its points on a grid; none where all lie in a plane.
    ///
    /// Points are added one by one: the triangles that see the new one go, and it is joined with
    /// the edges around them. On whole numbers no sign is wrong.
    pub(crate) fn hull(&self) -> Option<Packed> {
        let Packed { low, step, points: all, .. } = self.in_steps(COARSE);
        let side = |[a, b, c]: [usize; 3], p: usize| -> i64 {
            let from = |q: usize| [0, 1, 2].map(|k| all[q][k] - all[a][k]);
            let [[x, y, z], [u, v, w], [r, s, t]] = [from(b), from(c), from(p)];
            (y * w - z * v) * r + (z * u - x * w) * s + (x * v - y * u) * t
        };
        // a first tetrahedron
        let area = |c: &usize| {
            let from = |q: usize| [0, 1, 2].map(|k| all[q][k] - all[0][k]);
            let [[x, y, z], [u, v, w]] = [from(1), from(*c)];
            [y * w - z * v, z * u - x * w, x * v - y * u] != [0; 3]
        };
        let c = (2..all.len()).find(area)?;
        let d = (2..all.len()).find(|d| side([0, 1, c], *d) != 0)?;
        let [a, b] = if side([0, 1, c], d) < 0 { [0, 1] } else { [1, 0] };
        let mut faces = vec![[a, b, c], [b, a, d], [c, b, d], [a, c, d]];
        for p in 0..all.len() {
            if !faces.iter().any(|face| side(*face, p) > 0) {
                continue;
            }
            // a triangle in one plane with the point goes too: none shrinks to a line
            let (seen, kept): (Vec<[usize; 3]>, Vec<_>) =
                faces.into_iter().partition(|face| side(*face, p) >= 0);
            let edges = || seen.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
            let inner: std::collections::HashSet<[usize; 2]> = edges().collect();
            let rim = edges().filter(|[a, b]| !inner.contains(&[*b, *a]));
            faces = kept;
            faces.extend(rim.map(|[a, b]| [a, b, p]));
        }
        // the points that are left, numbered anew
        let mut places = HashMap::new();
        let mut points = Vec::new();
        let mut number = |p: usize| {
            *places.entry(p).or_insert_with(|| {
                points.push(all[p]);
                points.len() - 1
            })
        };
        let triangles = faces.into_iter().map(|face| face.map(&mut number)).collect();
        Some(Packed { low, step, points, triangles })
    }
}

fn text_stl(bytes: &[u8]) -> Option<Vec<[f64; 3]>> {
    let lines = str::from_utf8(bytes).ok()?.lines();
    lines.filter_map(|line| line.trim().strip_prefix("vertex ")).map(point).collect()
}

fn point(words: &str) -> Option<[f64; 3]> {
    let mut numbers = words.split_whitespace().map(|word| word.parse().ok());
    Some([numbers.next()??, numbers.next()??, numbers.next()??])
}

impl Packed {
    /// About how many letters the text has.
    pub(crate) fn len(&self) -> usize {
        let width = if self.is_wide() { 16 } else { 8 };
        200 + 8 * self.points.len() + width * self.triangles.len()
    }

    fn is_wide(&self) -> bool {
        self.points.len() > usize::from(u16::MAX)
    }

    /// `low`, `step`, and base64 of the little-endian `points` and `triangles`.
    pub(crate) fn value(&self) -> Value {
        let points = self.points.iter().flatten().flat_map(|x| (*x as u16).to_le_bytes());
        let numbers = self.triangles.iter().flatten();
        let triangles = match self.is_wide() {
            true => base64(numbers.flat_map(|x| (*x as u32).to_le_bytes())),
            false => base64(numbers.flat_map(|x| (*x as u16).to_le_bytes())),
        };
        json!({
            "low": self.low,
            "step": self.step,
            "points": base64(points),
            "wide": self.is_wide(),
            "triangles": triangles,
        })
    }
}

/// Bytes as letters.
pub(crate) fn base64(bytes: impl Iterator<Item = u8>) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bytes: Vec<u8> = bytes.collect();
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let of = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let bits = of(0) << 16 | of(1) << 8 | of(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k)) as usize % 64];
            text.push(if k <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// A cube of side 2 with points inside and on its faces.
    fn cube() -> Mesh {
        let mut points = Vec::new();
        for k in 0..27 {
            points.push([k % 3, k / 3 % 3, k / 9].map(f64::from));
        }
        let inner = [[0.7, 1.1, 1.3], [1.2, 0.4, 0.9], [1.7, 1.6, 0.2]];
        Mesh(points.into_iter().chain(inner).collect())
    }

    /// Six times the volume inside of triangles, in steps.
    fn volume(of: &Packed) -> i64 {
        let each = |face: &[usize; 3]| {
            let [[a, b, c], [d, e, f], [g, h, i]] = face.map(|k| of.points[k]);
            a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        };
        of.triangles.iter().map(each).sum()
    }

    #[test]
    fn a_hull_is_closed_and_holds_every_point() {
        let hull = cube().hull().unwrap();
        assert_eq!(volume(&hull), 6 * 511 * 511 * 511);
        // each edge is that of two triangles, one in each direction; Euler's number is 2
        let edges = hull.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let all: std::collections::HashSet<[usize; 2]> = edges.collect();
        assert_eq!(all.len(), 3 * hull.triangles.len());
        assert!(all.iter().all(|[a, b]| all.contains(&[*b, *a])));
        assert_eq!(hull.points.len() + hull.triangles.len(), all.len() / 2 + 2);

        // points on a sphere stay, and each lies on the inner side of each triangle
        let turn = |k: i32| [0.37, 0.61].map(|part| f64::from(k) * part * 7.0);
        let round = |k| {
            let [a, b] = turn(k);
            [a.sin() * b.cos(), a.sin() * b.sin(), a.cos()]
        };
        let mesh = Mesh((0..300).map(round).collect());
        let hull = mesh.hull().unwrap();
        let [low, _] = mesh.bounds();
        for face in &hull.triangles {
            let of = |k: usize| [0, 1, 2].map(|i| low[i] + hull.step[i] * hull.points[k][i] as f64);
            let [a, b, c] = face.map(of);
            let normal = nalgebra::Vector3::from(b) - nalgebra::Vector3::from(a);
            let normal = normal.cross(&(nalgebra::Vector3::from(c) - nalgebra::Vector3::from(a)));
            for p in &mesh.0 {
                let out = normal.dot(&(nalgebra::Vector3::from(*p) - nalgebra::Vector3::from(a)));
                assert!(out <= 0.006 * normal.norm(), "{out}");
            }
        }
        // points in a plane have none
        assert!(
            Mesh((0..9).map(|k| [f64::from(k), f64::from(k * k), 1.0]).collect()).hull().is_none()
        );
    }

    #[test]
    fn the_same_triangle_is_read_from_every_format() {
        let corners = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 2.0, 0.25]];
        let mut bytes = vec![b' '; 80];
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([0; 12]);
        bytes.extend(corners.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
        assert_eq!(binary_stl(&bytes).unwrap(), [corners]);
        assert!(binary_stl(&bytes[..130]).is_none());
        let text = "solid a\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0.5\n  vertex 1 0 0.5\n \
                    vertex 0 2 2.5e-1\n endloop\nendfacet\nendsolid a\n";
        assert_eq!(text_stl(text.as_bytes()).unwrap(), corners);
        let text = "# a\nv 0 0 0.5\nv 1 0 0.5\nv 0 2 0.25\nvn 0 0 1\nf 1//1 2//1 -1//1\n";
        assert_eq!(obj(text.as_bytes()).unwrap(), [corners]);
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        assert_eq!(obj(square.as_bytes()).unwrap().len(), 2);
        assert!(obj(b"v 0 0 0\nf 1 2 3\n").is_none());
        let letters = |text: &str| base64(text.bytes());
        assert_eq!(["any", "an", "a"].map(letters), ["YW55", "YW4=", "YQ=="]);
    }
}
