//! Zonotopes, the sums of segments g_i x_i, by the arrangement of the hyperplanes g_i · d = 0: a
//! vertex is a cell of it, with x_i at the end that the sign of g_i · d names, and the normal of a
//! facet is a line of it \[Z95\].

use crate::scalar::Real;

/// Part of a segment's length below which it lies along others.
const FLAT: f64 = 1e-10;
/// Part of the longest segment's length below which a segment is a point.
const POINT: f64 = 1e-14;

/// Segments in p dimensions, one a row, with their scratch: at most 64 of them.
pub(crate) struct Zonotope<'a, T> {
    /// The segments (m × p).
    segments: &'a [T],
    p: usize,
    /// Squared length of each below which it is zero (m).
    floors: &'a [T],
}

impl<'a, T: Real> Zonotope<'a, T> {
    /// Numbers of scratch for m segments in p dimensions.
    pub(crate) const fn scratch(m: usize, p: usize) -> usize {
        m + (p + 1) * m * p
    }

    /// Calls `visit` with the zonotope and the rest of the scratch.
    pub(crate) fn with<R>(
        segments: &[T],
        p: usize,
        scratch: &mut [T],
        visit: impl FnOnce(Zonotope<'_, T>, &mut [T]) -> R,
    ) -> R {
        let (floors, rest) = scratch.split_at_mut(segments.len().checked_div(p).unwrap_or(0));
        let rows = || segments.chunks_exact(p.max(1));
        let longest = rows().fold(T::ZERO, |most: T, g| most.larger(dot(g, g)));
        for (floor, g) in floors.iter_mut().zip(rows()) {
            let own = dot(g, g) * T::from_f64(FLAT * FLAT);
            *floor = own.larger(longest * T::from_f64(POINT * POINT));
        }
        visit(Zonotope { segments, p, floors }, rest)
    }

    /// The vertices, each as the set of the segments that are at their upper end, ascending, into
    /// `found`; returns their number, at most the length of `found`.
    pub(crate) fn vertices(&self, rest: &mut [T], found: &mut [u64]) -> usize {
        let all = self.floors.iter().enumerate().fold(0, |all, (i, _)| all | 1 << i);
        let mut cells = Cells { found, n: 0 };
        self.cells(rest, all, 0, &mut cells);
        cells.n
    }

    /// Calls `visit` with each line of the arrangement, some more than once: the normals of the
    /// facets in the span of the segments.
    pub(crate) fn normals(&self, rest: &mut [T], visit: &mut dyn FnMut(&[T])) {
        self.lines(rest, 0, visit);
    }

    /// The part of `x` across the span of the segments, in place.
    pub(crate) fn across(&self, rest: &mut [T], x: &mut [T]) {
        let mut here = Zonotope { ..*self };
        let mut rest = rest;
        while let Some(i) = (0..self.floors.len()).find(|i| !here.is_flat(*i)) {
            let axis = here.row(i);
            let along = dot(x, axis) / dot(axis, axis);
            x.iter_mut().zip(axis).for_each(|(x, a)| *x = (-along).mul_add(*a, *x));
            let (next, behind) = core::mem::take(&mut rest).split_at_mut(self.segments.len());
            here.project(i, next);
            (here, rest) = (Zonotope { segments: next, ..*self }, behind);
        }
    }

    fn row(&self, i: usize) -> &[T] {
        &self.segments[i * self.p..(i + 1) * self.p]
    }

    fn is_flat(&self, i: usize) -> bool {
        let g = self.row(i);
        !self.floors[i].lt(dot(g, g))
    }

    /// The segments without their parts along segment i.
    fn project(&self, i: usize, to: &mut [T]) {
        let axis = self.row(i);
        let square = dot(axis, axis);
        let rows = self.segments.chunks_exact(self.p).zip(to.chunks_exact_mut(self.p));
        for (k, (g, to)) in rows.enumerate() {
            let along = dot(g, axis) / square;
            for ((to, g), a) in to.iter_mut().zip(g).zip(axis) {
                *to = if k == i { T::ZERO } else { (-along).mul_add(*a, *g) };
            }
        }
    }

    /// Adds the cells around each wall: the cells of the arrangement in the wall, on both its
    /// sides. `open` are the segments without a sign yet, `upper` those with a positive one.
    fn cells(&self, rest: &mut [T], open: u64, upper: u64, cells: &mut Cells<'_>) {
        let is_open = |set: u64, i: &usize| set >> i & 1 == 1 && !self.is_flat(*i);
        let n = self.floors.len();
        if (0..n).all(|i| !is_open(open, &i)) {
            return cells.insert(upper);
        }
        // a wall of several segments is looked at once
        let mut left = open;
        while let Some(i) = (0..n).find(|i| is_open(left, i)) {
            let (next, behind) = rest.split_at_mut(self.segments.len());
            self.project(i, next);
            let within = Zonotope { segments: next, ..*self };
            let mut along = 1 << i;
            let mut against = 0;
            let others = open & !along;
            for j in (0..n).filter(|j| is_open(others, j) && within.is_flat(*j)) {
                let same = T::ZERO.lt(dot(self.row(i), self.row(j)));
                *(if same { &mut along } else { &mut against }) |= 1 << j;
            }
            left &= !(along | against);
            let open = open & !(along | against);
            within.cells(behind, open, upper | along, cells);
            within.cells(behind, open, upper | against, cells);
        }
    }

    fn lines(&self, rest: &mut [T], from: usize, visit: &mut dyn FnMut(&[T])) {
        let n = self.floors.len();
        let Some(first) = (0..n).find(|i| !self.is_flat(*i)) else { return };
        let (next, behind) = rest.split_at_mut(self.segments.len());
        self.project(first, next);
        let within = Zonotope { segments: next, ..*self };
        if (0..n).all(|i| within.is_flat(i)) {
            let square = |i: &usize| dot(self.row(*i), self.row(*i));
            let longest = (0..n).fold(first, |a, b| if square(&a).lt(square(&b)) { b } else { a });
            return visit(self.row(longest));
        }
        for i in (from..n).filter(|i| !self.is_flat(*i)) {
            self.project(i, next);
            Zonotope { segments: next, ..*self }.lines(behind, i + 1, visit);
        }
    }
}

/// Sets of segments, ascending, each once.
struct Cells<'a> {
    found: &'a mut [u64],
    n: usize,
}

impl Cells<'_> {
    fn insert(&mut self, cell: u64) {
        if let Err(at) = self.found[..self.n].binary_search(&cell)
            && self.n < self.found.len()
        {
            self.found.copy_within(at..self.n, at + 1);
            self.found[at] = cell;
            self.n += 1;
        }
    }
}

pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| a.mul_add(*b, sum))
}
