//! Answers of the control service: who is here, what the model is, plans and lanes.

use std::sync::Arc;

use iceoryx2::node::Node;
use sarrus_dynamics::Model;
use sarrus_proto::PROTOCOL_VERSION;
use sarrus_proto::board::class_of;
use sarrus_proto::lane::{Threadsafe, copy_once};
use sarrus_proto::message::{Call, ControlRequest, ControlResponse, PAGE, Refusal};
use sarrus_proto::service::ControlServer;

use crate::engine::{Plans, Registered, Unplanned};
use crate::lanes::{Lanes, NoLane};

/// The control service's side of the server.
pub(crate) struct Control {
    pub(crate) port: ControlServer,
    pub(crate) instance: u64,
    pub(crate) model: Arc<Model<f64>>,
    pub(crate) plans: Arc<Plans>,
    pub(crate) info: Vec<u8>,
    pub(crate) fingerprint: u64,
}

/// A refusal with the words and numbers that go with it.
type Refused = (Refusal, String, [u64; 4]);
/// The numbers and the text of an answer.
type Granted = ([u64; 4], Vec<u8>);

impl Control {
    /// Answers every call that waits; true when there was one.
    pub(crate) fn serve(&self, node: &Node<Threadsafe>, lanes: &mut Lanes, stopping: bool) -> bool {
        let mut any = false;
        // an error concerns a client that is about to go
        while let Ok(Some(active)) = self.port.receive() {
            any = true;
            let request = copy_once(active.payload());
            let outcome = match stopping {
                false => self.answer(&request, node, lanes),
                true => Err((Refusal::Stopping, String::new(), [0; 4])),
            };
            // a client that went away needs no answer
            let _ = active.send_copy(self.response(outcome));
        }
        any
    }

    fn answer(
        &self,
        request: &ControlRequest,
        node: &Node<Threadsafe>,
        lanes: &mut Lanes,
    ) -> Result<Granted, Refused> {
        let refused = |refusal| (refusal, String::new(), [0; 4]);
        if request.version != PROTOCOL_VERSION {
            return Err(refused(Refusal::WrongVersion));
        }
        if request.fingerprint != 0 && request.fingerprint != self.fingerprint {
            return Err(refused(Refusal::WrongModel));
        }
        match Call::from_code(request.call) {
            Some(Call::Hello) => Ok(([self.info.len() as u64, 0, 0, 0], Vec::new())),
            Some(Call::Model) => {
                let page = usize::try_from(request.arguments[0])
                    .ok()
                    .and_then(|page| self.info.chunks(PAGE).nth(page));
                page.map(|page| ([page.len() as u64, 0, 0, 0], page.to_vec()))
                    .ok_or_else(|| refused(Refusal::NoSuchPage))
            }
            Some(Call::Plan) => match self.plans.register(&self.model, &request.query) {
                Ok(Registered { plan, n_in, n_out }) => {
                    Ok(([plan.into(), n_in as u64, n_out as u64, 0], Vec::new()))
                }
                Err(Unplanned::Query(error)) => Err((Refusal::BadQuery, error.to_string(), [0; 4])),
                Err(Unplanned::TooLarge { n_in, n_out }) => {
                    Err((Refusal::TooLarge, String::new(), [n_in as u64, n_out as u64, 0, 0]))
                }
                Err(Unplanned::TooMany) => Err(refused(Refusal::TooManyPlans)),
            },
            Some(Call::Lane) => {
                let class = |n: u64| usize::try_from(n).ok().and_then(class_of);
                let [n_in, n_out] = request.arguments;
                let (Some(class_in), Some(class_out)) = (class(n_in), class(n_out)) else {
                    return Err((Refusal::TooLarge, String::new(), [n_in, n_out, 0, 0]));
                };
                match lanes.make(node, [class_in, class_out]) {
                    Ok(id) => Ok((
                        [id.slot.into(), id.generation.into(), class_in as u64, class_out as u64],
                        Vec::new(),
                    )),
                    Err(NoLane::Full) => {
                        Err((Refusal::NoLane, String::new(), [lanes.len() as u64, 0, 0, 0]))
                    }
                    Err(NoLane::Failed(error)) => Err((Refusal::Failed, error.to_string(), [0; 4])),
                }
            }
            _ => Err(refused(Refusal::UnknownCall)),
        }
    }

    fn response(&self, outcome: Result<Granted, Refused>) -> ControlResponse {
        let (refusal, numbers, bytes) = match outcome {
            Ok((numbers, bytes)) => (0, numbers, bytes),
            Err((refusal, words, numbers)) => (refusal as u32, numbers, words.into_bytes()),
        };
        let mut text = [0; PAGE];
        let n_text = bytes.len().min(PAGE);
        text[..n_text].copy_from_slice(&bytes[..n_text]);
        let (version, fingerprint, instance) = (PROTOCOL_VERSION, self.fingerprint, self.instance);
        ControlResponse {
            version,
            refusal,
            fingerprint,
            instance,
            numbers,
            n_text: n_text as u64,
            text,
        }
    }
}
