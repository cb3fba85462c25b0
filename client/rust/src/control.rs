//! Calls of the control service.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::message::{
    Call, ControlRequest, ControlResponse, MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, PAGE,
    Refusal,
};
use sarrus_proto::service::{ControlClient, open_control};
use sarrus_proto::{FieldSet, ModelInfo, PROTOCOL_VERSION, Query, Request, ServerName};

use crate::{ConnectError, Error, Prepared};

/// A port of the control service, open while a client attaches or registers plans.
pub(crate) struct Control<'a> {
    node: &'a Node<Threadsafe>,
    name: &'a ServerName,
    port: ControlClient,
    fingerprint: u64,
    deadline: Instant,
    timeout: Duration,
    instance: u64,
}

impl<'a> Control<'a> {
    /// Opens the service and says hello. Fails where the model has another fingerprint than
    /// `fingerprint`, if that is given.
    pub(crate) fn open(
        node: &'a Node<Threadsafe>,
        name: &'a ServerName,
        fingerprint: Option<u64>,
        deadline: Instant,
    ) -> Result<(Control<'a>, Hello), ConnectError> {
        let timeout = deadline.saturating_duration_since(Instant::now());
        let port = open_control(node, name)
            .map_err(|error| ConnectError::of_service(name.as_str(), error))?;
        let mut control = Control {
            node,
            name,
            port,
            fingerprint: fingerprint.unwrap_or(0),
            deadline,
            timeout,
            instance: 0,
        };
        let response = control.granted(Call::Hello, [0; 2], None)?;
        control.fingerprint = response.fingerprint;
        control.instance = response.instance;
        Ok((
            control,
            Hello {
                fingerprint: response.fingerprint,
                instance: response.instance,
                info_bytes: response.numbers[0] as usize,
            },
        ))
    }

    /// The model information.
    pub(crate) fn model(&self, hello: &Hello) -> Result<ModelInfo, ConnectError> {
        let mut bytes = Vec::new();
        for page in 0..hello.info_bytes.div_ceil(PAGE) {
            bytes.extend_from_slice(self.granted(Call::Model, [page as u64, 0], None)?.text());
        }
        ModelInfo::from_json(&bytes).ok_or(ConnectError::BadAnswer { what: "about the model" })
    }

    /// Registers a plan; the server's number of it.
    pub(crate) fn plan(&self, prepared: &Prepared) -> Result<u32, Error> {
        let response = self.call(Call::Plan, [0; 2], Some(prepared.query()))?;
        let [number, n_in, n_out, _] = response.numbers;
        match Refusal::from_code(response.refusal) {
            // client and server must mean the same numbers
            None if response.refusal == 0
                && [n_in, n_out]
                    == [prepared.given().len() as u64, prepared.want().len() as u64] =>
            {
                Ok(number as u32)
            }
            None => Err(ConnectError::BadAnswer { what: "for a plan" }.into()),
            Some(Refusal::BadQuery) => Err(Error::NotPlanned {
                reason: String::from_utf8_lossy(response.text()).into_owned(),
            }),
            Some(Refusal::TooLarge) => {
                let [n_in, n_out, ..] = response.numbers.map(|n| n as usize);
                Err(Error::TooLarge {
                    n_in,
                    n_out,
                    max_in: MAX_NUMBERS_IN,
                    max_out: MAX_NUMBERS_OUT,
                })
            }
            Some(Refusal::TooManyPlans) => Err(Error::TooManyPlans { limit: MAX_PLANS }),
            refusal => Err(ConnectError::of_refusal(refusal, &response, self.fingerprint).into()),
        }
    }

    /// A lane of one's own that holds so many numbers each way.
    pub(crate) fn lane(
        &self,
        [n_in, n_out]: [usize; 2],
    ) -> Result<(ClaimedLane, [usize; 2]), ConnectError> {
        let response = self.granted(Call::Lane, [n_in as u64, n_out as u64], None)?;
        let (id, class_in, class_out) = response.lane();
        let classes = [class_in, class_out];
        let lane = ClaimedLane::claim(self.node, self.name, self.instance, id, classes);
        Ok((lane.map_err(|error| ConnectError::of_service(self.name.as_str(), error))?, classes))
    }

    fn granted(
        &self,
        call: Call,
        arguments: [u64; 2],
        query: Option<&Query>,
    ) -> Result<ControlResponse, ConnectError> {
        let response = self.call(call, arguments, query)?;
        if response.refusal == 0 {
            return Ok(response);
        }
        Err(ConnectError::of_refusal(
            Refusal::from_code(response.refusal),
            &response,
            self.fingerprint,
        ))
    }

    fn call(
        &self,
        call: Call,
        arguments: [u64; 2],
        query: Option<&Query>,
    ) -> Result<ControlResponse, ConnectError> {
        const NOTHING: Query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::EMPTY);
        let query = *query.unwrap_or(&NOTHING);
        let request = ControlRequest {
            version: PROTOCOL_VERSION,
            call: call as u32,
            fingerprint: self.fingerprint,
            arguments,
            query,
        };
        let silent = || ConnectError::NoAnswer {
            name: self.name.as_str().to_owned(),
            timeout: self.timeout,
        };
        let pending = self.port.send_copy(request).map_err(|_| silent())?;
        if pending.number_of_server_connections() == 0 {
            return Err(ConnectError::NoServer { name: self.name.as_str().to_owned() });
        }
        loop {
            match pending.receive() {
                Ok(Some(response)) => return Ok(*response.payload()),
                Ok(None) if Instant::now() < self.deadline => {
                    std::thread::sleep(Duration::from_micros(100))
                }
                _ => return Err(silent()),
            }
        }
    }
}

/// What the server says of itself.
pub(crate) struct Hello {
    pub(crate) fingerprint: u64,
    pub(crate) instance: u64,
    info_bytes: usize,
}
