//! Chooses the closure of a cluster: the closed form of its type, the same form as start of
//! Newton's method, or Newton's method alone.

use sarrus_proto::{ClosureInfo, ClosureKind};

use crate::closure::{Closure, Numerical};
use crate::compile::CLOSED_FORMS;
use crate::compile::assemble::{Assembly, Labels};
use crate::compile::closed_forms::{self, Form};
use crate::description::{Description, Submechanism, SubmechanismKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::mechanism::{Body, Cluster, CutRow};
use crate::scalar::{Dd, Real};

/// Misfit up to which a closed form is exact: the rounding of numbers in a file.
const ROUNDING: f64 = 1e-13;
/// Misfit up to which a closed form starts Newton's method on the true rows.
const POLISHABLE: f64 = 1e-3;

/// A cluster that Newton's method closes at its zero pose.
pub(super) struct Candidate<'a> {
    pub(super) description: &'a Description,
    pub(super) assembly: &'a Assembly,
    pub(super) c: usize,
    pub(super) labels: &'a Labels,
    pub(super) cluster: &'a Cluster<Dd>,
    pub(super) bodies: &'a [Body<Dd>],
    pub(super) numerical: Numerical<Dd>,
}

impl Candidate<'_> {
    /// The closure, and its kind and misfit in the reports; `None` after an error. `described_zero`
    /// holds the cluster's coordinates at the described zero pose.
    pub(super) fn choose_closure(
        mut self,
        described_zero: &[f64],
        closures: &mut [ClosureInfo],
        errors: &mut Vec<Diagnostic>,
        warnings: &mut Vec<Diagnostic>,
    ) -> Option<Closure<Dd>> {
        let mut rows = self.cluster.cuts.iter().flat_map(|cut| &cut.rows);
        if rows.all(CutRow::is_linear) && self.cluster.n_q == self.cluster.n {
            errors.push(self.contradicting_couplings());
            return None;
        }
        let mut kind = self.kind();
        let order = self.assembly.local_order(self.description, self.c);
        let zero: Vec<Dd> = described_zero.iter().map(|x| Dd::from_f64(*x)).collect();
        if closed_forms::has_change_point(self.cluster, self.bodies, &order, &zero) {
            self.numerical.set_meets();
        }
        let form = |kind| closed_forms::build(kind, self.cluster, self.bodies, &order, &zero);
        let mut found = form(kind);
        if let Some(Err(reason)) = &found {
            let fits = |(name, other): &(&'static str, SubmechanismKind)| {
                let form = form(*other)?.ok().filter(|form| form.misfit_size() <= POLISHABLE)?;
                Some((*name, *other, form))
            };
            if let Some((name, other, form)) = CLOSED_FORMS.iter().find_map(fits) {
                warnings.push(self.other_geometry(reason, name));
                (kind, found) = (other, Some(Ok(form)));
            }
        }
        let closure = match found {
            Some(Ok(form)) => self.fit(form, kind, closures, errors, warnings)?,
            refused => {
                warnings.extend(match refused {
                    Some(Err(reason)) => Some(self.wrong_geometry(&reason)),
                    _ => self.no_closed_form(kind),
                });
                if self.submechanism().closed_forms {
                    self.numerical.form = closed_forms::recognised(
                        self.cluster,
                        self.bodies,
                        &zero,
                        &self.numerical,
                        ROUNDING,
                    );
                }
                Closure::Numerical(self.numerical)
            }
        };
        if matches!(closure, Closure::Numerical(_)) {
            for (s, _) in self.assembly.owners(self.c) {
                if closures[s].rows > 0 {
                    closures[s].kind = ClosureKind::Numerical;
                }
            }
        }
        Some(closure)
    }

    /// The closed form alone, the form and Newton's method, or Newton's method, by the misfit.
    fn fit(
        &mut self,
        mut form: Form,
        kind: SubmechanismKind,
        closures: &mut [ClosureInfo],
        errors: &mut Vec<Diagnostic>,
        warnings: &mut Vec<Diagnostic>,
    ) -> Option<Closure<Dd>> {
        let velocity = |body: &Body<Dd>| self.labels.names[body.v - self.cluster.v].clone();
        let body_names: Vec<String> = self.bodies.iter().map(velocity).collect();
        let (worst, misfit) = form.misfit(&body_names);
        for (s, _) in self.assembly.owners(self.c) {
            closures[s].misfit = f64::max(closures[s].misfit, misfit);
        }
        let exact_geometry = match kind {
            SubmechanismKind::ParallelogramChain => {
                Some("opposite sides equal and axes parallel, or type FOURBAR")
            }
            SubmechanismKind::Surrpr2U1 => {
                Some("axes of each rod's universal joint that cross at a right angle")
            }
            _ => None,
        };
        let site = self.labels.site;
        if misfit > POLISHABLE {
            let Some(expected) = exact_geometry else {
                errors.push(Diagnostic::new(
                    site,
                    format!("{worst}: off by {misfit:.3e} of the mechanism's size"),
                    format!("at most {POLISHABLE} for the closed form of {}", self.type_name()),
                    "correct the axis or origin, or write type NUMERICAL",
                ));
                return None;
            };
            let found = format!("{worst} by {misfit:.3e} of the mechanism's size");
            warnings.push(Diagnostic::new(site, found, expected, "it is closed numerically"));
            return Some(Closure::Numerical(self.numerical.clone()));
        }
        if kind == SubmechanismKind::Surrpr2U1
            && !form.agrees(&self.numerical, self.cluster, self.bodies)
        {
            warnings.push(Diagnostic::new(
                site,
                "a closed form that Newton's method does not confirm beside the zero pose",
                "a zero pose away from dead points",
                "it is closed numerically",
            ));
            return Some(Closure::Numerical(self.numerical.clone()));
        }
        if misfit > ROUNDING {
            form.polish(self.numerical.clone());
        }
        Some(form.closure())
    }

    /// The submechanism's kind if the cluster is all of it, else numerical; parallelograms of one
    /// chain may be clusters of their own.
    fn kind(&self) -> SubmechanismKind {
        if !self.submechanism().closed_forms {
            return SubmechanismKind::Numerical;
        }
        let submechanisms = &self.description.submechanisms;
        let kind = match self.assembly.owners(self.c).as_slice() {
            [(s, n)]
                if submechanisms[*s].kind == SubmechanismKind::ParallelogramChain
                    || *n == submechanisms[*s].spanning_tree.len() =>
            {
                submechanisms[*s].kind
            }
            _ => SubmechanismKind::Numerical,
        };
        // other closed forms count from joints at rest
        let is_platform = matches!(
            kind,
            SubmechanismKind::Spu2U1 | SubmechanismKind::Sprr2U1 | SubmechanismKind::Ups6
        );
        let members = &self.assembly.members[self.c];
        match self.description.zero_pose.iter().any(|(j, _)| members.contains(j)) {
            true if !is_platform => SubmechanismKind::Numerical,
            _ => kind,
        }
    }

    fn submechanism(&self) -> &Submechanism {
        &self.description.submechanisms[self.assembly.owner[self.c]]
    }

    fn type_name(&self) -> &str {
        &self.submechanism().type_name
    }

    /// Couplings of full rank that no pose satisfies.
    fn contradicting_couplings(&self) -> Diagnostic {
        let names = self.labels.names.join(", ");
        Diagnostic::new(
            self.labels.site,
            format!("couplings between {names} that contradict each other"),
            "as many couplings as dependent joints, or more that repeat them",
            "take out a coupling, or correct its multipliers and offset",
        )
    }

    /// A cluster of a type with a closed form that has another geometry.
    fn wrong_geometry(&self, reason: &str) -> Diagnostic {
        Diagnostic::new(
            self.labels.site,
            format!("a {} whose {reason}", self.type_name()),
            "the geometry that the type's closed form assumes",
            "it is closed numerically; write NUMERICAL to say so",
        )
    }

    /// A cluster of a type with a closed form that has the geometry of another.
    fn other_geometry(&self, reason: &str, name: &str) -> Diagnostic {
        Diagnostic::new(
            self.labels.site,
            format!("a {} whose {reason}: its geometry is that of a {name}", self.type_name()),
            format!("type {name}"),
            format!("it is closed as a {name}; write type: {name}"),
        )
    }

    /// A type without a closed form, or with loops where its form has couplings.
    fn no_closed_form(&self, kind: SubmechanismKind) -> Option<Diagnostic> {
        let (expected, help) = match kind {
            SubmechanismKind::Numerical | SubmechanismKind::Serial => return None,
            SubmechanismKind::Transmission | SubmechanismKind::Differential => {
                ("couplings (<mimic>, <transmission>) and no loops", "write NUMERICAL to say so")
            }
            _ => (
                "a type with a closed form: RRPR, 2SPU+1U, 2SPRR+1U, 2SURRPR+1U, 6UPS, FOURBAR, \
                SLIDERCRANK, PARALLELOGRAMCHAIN, TRANSMISSION, DIFFERENTIAL",
                "nothing to do: it is closed numerically from its loops",
            ),
        };
        let site = Site::Submechanism(self.assembly.owner[self.c]);
        Some(Diagnostic::new(site, format!("type {}", self.type_name()), expected, help))
    }
}
