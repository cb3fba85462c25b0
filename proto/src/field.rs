//! The named blocks of numbers that requests give and answers hold.

use core::fmt;
use core::ops::{BitOr, BitOrAssign};

use crate::{Field, Sizes};

/// Numbers of a task in [`Field::TaskTarget`].
pub const TASK_NUMBERS: usize = 11;
/// Most solutions of one answer.
pub const MAX_SOLUTIONS: usize = 16;

/// Most coordinates of a set of vertices.
pub const MOST_VERTEX_COORDINATES: usize = 4;
/// Most vertices of an answer.
pub const MOST_VERTICES: usize = 512;

/// Rows for the vertices of a sum of m segments in p dimensions, 2 Σ_{k<p} C(m − 1, k), at most
/// [`MOST_VERTICES`].
pub const fn most_vertices(m: usize, p: usize) -> usize {
    let mut sum = 0;
    let mut choices = 1;
    let mut k = 0;
    while k < p && sum < MOST_VERTICES {
        sum += 2 * choices;
        choices = choices * m.saturating_sub(k + 1) / (k + 1);
        k += 1;
    }
    if sum < MOST_VERTICES { sum } else { MOST_VERTICES }
}

impl Field {
    /// (rows, columns) on a model of the given sizes; a vector has one column, matrices are packed
    /// row by row. [`Field::has_direction_rows`] has those of one direction.
    pub const fn shape(self, s: &Sizes, n_frames: usize, n_wrenches: usize) -> (usize, usize) {
        self.shape_of_rows(s, s, n_frames, n_wrenches)
    }

    /// The shape if a query picks the rows of some joints; the sizes `p` count them.
    pub const fn shape_of_rows(
        self,
        s: &Sizes,
        p: &Sizes,
        n_frames: usize,
        n_wrenches: usize,
    ) -> (usize, usize) {
        use Field::*;
        match self {
            Y | NearestY => (p.n_qy, 1),
            Yd | Ydd | TauY | TauUnactuated | CY | TauExternal => (p.n_vy, 1),
            Q => (p.n_q, 1),
            Qd | Qdd | TauQ | GBias => (p.n_v, 1),
            QGuess => (s.n_q, 1),
            QdGuess | GoodIndependents => (s.n_v, 1),
            U | Ud | Udd | TauU | GUBias => (p.n_u, 1),
            Wrenches => (n_wrenches, 6),
            G | Gd | DqddDy | DgBiasDyd => (p.n_v, s.n_vy),
            GU | DtauUDy | DtauUDyd => (p.n_u, s.n_vy),
            DyddDtauU => (p.n_vy, s.n_u),
            K => (s.n_c, s.n_v),
            KBias | Lambda | LambdaDeterminate => (s.n_c, 1),
            MY | ReflectedInertia | ReflectedDamping | DtauYDy | DtauYDyd => (p.n_vy, s.n_vy),
            DyddDy | DyddDyd | DtauUnactuatedDy | DtauUnactuatedDyd => (p.n_vy, s.n_vy),
            Dt | Gain | TorqueSupport | TorqueSupportNet | Margin | Clearance => (1, 1),
            Observer => (s.n_vy, 3),
            Residual | Iterations | CondKd | CondGu | SigmaMin | CondMy | Projection => (1, 1),
            Uncontrolled | Multipliers => (s.n_vy, 1),
            Limits => (p.n_v, 3),
            FramePose | TaskMotion => (n_frames, 7),
            FrameTwist | FrameAcc | JdYd | ContactForces => (n_frames, 6),
            JacobianTree => (6 * n_frames, s.n_v),
            JacobianIndependent | DjacobianDy => (6 * n_frames, s.n_vy),
            JacobianActuator => (6 * n_frames, s.n_u),
            Branch => (s.n_branches, 1),
            Directions => (1, s.n_vy),
            GainsU | BoundsU => (s.n_u, 2),
            TorqueVertices | TorqueVerticesNet | SpeedVertices => {
                (most_vertices(s.n_u, p.n_vy), p.n_vy)
            }
            ReflectedForce | Clip | ClipNearest => (p.n_vy, 1),
            GainsY => (p.n_vy, 2 * s.n_vy + 1),
            Com | ComBias | ComTarget => (3, 1),
            ComJacobian => (3, s.n_vy),
            Momentum => (6, 1),
            Centroidal => (6, s.n_vy),
            Energy | TaskRank => (2, 1),
            TaskInertia => (6 * n_frames, 6 * n_frames),
            TaskBias | TaskGravity => (6 * n_frames, 1),
            TaskTarget => (n_frames, TASK_NUMBERS),
            BoundsY => (s.n_qy, 2),
            YGuess | YPreferred => (s.n_qy, 1),
            TaskResidual => (n_frames + 1, 1),
            Binding => (s.n_v + 1, 3),
            Solutions => (MAX_SOLUTIONS, s.n_qy),
            RegressorY => (p.n_vy, s.n_parameters()),
            RegressorU => (p.n_u, s.n_parameters()),
            Direction => (2 * s.n_vy + s.n_u, 1),
            BaseParameters => (s.n_parameters(), 1),
            DgammaDtheta => (p.n_v + 6 * n_frames, s.n_geometry()),
            D2TauYV => (p.n_vy, 2 * s.n_vy),
            D2YddV => (p.n_vy, 2 * s.n_vy + s.n_u),
        }
    }

    /// True for fields with these rows for each direction of [`crate::Query::n_directions`].
    pub const fn has_direction_rows(self) -> bool {
        matches!(self, Field::Directions | Field::TorqueSupport | Field::TorqueSupportNet)
    }

    /// True for sets of vertices, each a row.
    pub const fn has_vertex_rows(self) -> bool {
        matches!(self, Field::TorqueVertices | Field::TorqueVerticesNet | Field::SpeedVertices)
    }

    /// True for fields of actuators, which are NaN where an actuator has no limit.
    pub const fn is_of_motors(self) -> bool {
        self as u8 >= Field::TorqueVertices as u8 && self as u8 <= Field::Binding as u8
    }

    /// True for fields that depend on the joints that [`crate::Query::joints`] picks.
    pub fn has_joint_rows(self) -> bool {
        if matches!(self, Field::Margin | Field::Binding) {
            return true;
        }
        let none = Sizes::default();
        let one = Sizes { n_q: 1, n_v: 1, n_qy: 1, n_vy: 1, n_u: 1, ..none };
        self.shape_of_rows(&none, &one, 0, 0).0 > self.shape(&none, 0, 0).0
    }

    /// True for derivatives.
    pub const fn is_derivative(self) -> bool {
        let is_other = self as u8 >= Field::Gd as u8 && self as u8 <= Field::DjacobianDy as u8;
        is_other || self.is_derivative_of_forces()
    }

    /// True for derivatives that need forces and masses.
    pub const fn is_derivative_of_forces(self) -> bool {
        let is_first = self as u8 >= Field::DtauYDy as u8 && (self as u8) < Field::Gd as u8;
        is_first || self.is_second()
    }

    /// True for second derivatives along a direction.
    pub const fn is_second(self) -> bool {
        matches!(self, Field::D2TauYV | Field::D2YddV)
    }

    /// The field of a name, as in scripts.
    pub fn from_name(name: &str) -> Option<Field> {
        Field::ALL.iter().copied().find(|field| field.name() == name)
    }

    /// True for fields that a failed answer may still carry.
    pub const fn survives_failure(self) -> bool {
        use Field::*;
        matches!(
            self,
            Residual | Iterations | NearestY | SigmaMin | GoodIndependents | Uncontrolled | Binding
        )
    }
}

impl AsRef<str> for Field {
    fn as_ref(&self) -> &str {
        self.name()
    }
}

/// A set of fields, as the bits of their numbers: fields have numbers up to 127. As text it is two
/// words, the lower first.
///
/// ```
/// use sarrus_proto::{Field, FieldSet};
///
/// let state = Field::Q | Field::Qd;
/// let mut asked = state | Field::U;
/// asked |= Field::Ud;
/// assert!(asked.contains(state) && !state.contains(asked));
/// assert_eq!(asked.without(state).to_string(), "u, ud");
/// assert_eq!([Field::U, Field::Ud].into_iter().collect::<FieldSet>(), asked.without(state));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "transport", serde(from = "[u64; 2]", into = "[u64; 2]"))]
#[repr(transparent)]
pub struct FieldSet(pub u128);

impl FieldSet {
    /// The empty set.
    pub const EMPTY: FieldSet = FieldSet(0);

    /// The set of the given fields.
    pub const fn of(fields: &[Field]) -> FieldSet {
        let mut bits = 0;
        let mut k = 0;
        while k < fields.len() {
            bits |= 1 << fields[k] as u8;
            k += 1;
        }
        FieldSet(bits)
    }

    /// True when the field is in the set.
    pub const fn has(self, field: Field) -> bool {
        self.0 >> field as u8 & 1 == 1
    }

    /// True when any of the fields is in the set.
    pub const fn has_any(self, fields: &[Field]) -> bool {
        self.0 & FieldSet::of(fields).0 != 0
    }

    /// True when every field of `other` is in the set.
    pub const fn contains(self, other: FieldSet) -> bool {
        self.0 & other.0 == other.0
    }

    /// True when no field is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set with one field more.
    #[must_use]
    pub const fn with(self, field: Field) -> FieldSet {
        FieldSet(self.0 | 1 << field as u8)
    }

    /// The fields of the set that are not in the other.
    #[must_use]
    pub const fn without(self, other: FieldSet) -> FieldSet {
        FieldSet(self.0 & !other.0)
    }

    /// The fields of the set, in packing order.
    pub fn iter(self) -> impl Iterator<Item = Field> {
        Field::ALL.iter().copied().filter(move |field| self.has(*field))
    }

    /// True if this version knows the field of every bit.
    pub fn is_known(self) -> bool {
        self.0 & !FieldSet::of(Field::ALL).0 == 0
    }
}

impl From<[u64; 2]> for FieldSet {
    fn from([low, high]: [u64; 2]) -> FieldSet {
        FieldSet(u128::from(low) | u128::from(high) << 64)
    }
}

impl From<FieldSet> for [u64; 2] {
    fn from(FieldSet(bits): FieldSet) -> [u64; 2] {
        [bits as u64, (bits >> 64) as u64]
    }
}

impl From<Field> for FieldSet {
    fn from(field: Field) -> FieldSet {
        FieldSet::EMPTY.with(field)
    }
}

impl<S: Into<FieldSet>> BitOr<S> for FieldSet {
    type Output = FieldSet;

    /// The union.
    fn bitor(self, other: S) -> FieldSet {
        FieldSet(self.0 | other.into().0)
    }
}

impl<S: Into<FieldSet>> BitOr<S> for Field {
    type Output = FieldSet;

    fn bitor(self, other: S) -> FieldSet {
        FieldSet::from(self) | other
    }
}

impl<S: Into<FieldSet>> BitOrAssign<S> for FieldSet {
    fn bitor_assign(&mut self, other: S) {
        *self = *self | other;
    }
}

impl FromIterator<Field> for FieldSet {
    fn from_iter<I: IntoIterator<Item = Field>>(fields: I) -> FieldSet {
        fields.into_iter().fold(FieldSet::EMPTY, FieldSet::with)
    }
}

impl fmt::Display for FieldSet {
    /// The names of the fields in packing order, with commas between them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, field) in self.iter().enumerate() {
            f.write_str(if k == 0 { "" } else { ", " })?;
            f.write_str(field.name())?;
        }
        Ok(())
    }
}
