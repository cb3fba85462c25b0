//! Simulated motors: their answers to frames, and the motion of their shafts. For tests and
//! end-to-end runs.
//!
//! This crate follows the makers' manuals, not the drives of [`sarrus_can_core::protocol`]: the two
//! check each other. No I/O and no clock; frames and times are arguments. To add a protocol: a file
//! here, and its line in `firmware` below.

#![forbid(unsafe_code)]

mod ak_servo;
mod cia402;
mod cybergear;
mod dbc;
mod mit;
mod moteus;
mod odrive;
mod plant;
mod rmd;
mod vesc;

pub use plant::{Physics, Plant};

use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// A motor's firmware. Its checks are those of the real one.
trait Firmware: Send + core::fmt::Debug {
    /// Reads a frame; returns whether it was for this motor.
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool;

    /// Advances time: watchdogs, which remove power unless the firmware reacts otherwise, and
    /// cyclic frames of the motor.
    fn step(&mut self, plant: &mut Plant, _out: &mut FrameQueue) {
        if plant.trips() {
            plant.stop();
        }
    }
}

/// A simulated motor.
#[derive(Debug)]
pub struct Simulated {
    /// Shaft, power, watchdog.
    pub plant: Plant,
    made_of: (String, Settings, Common, Physics),
    firmware: Box<dyn Firmware>,
    stepped_ns: Option<u64>,
    /// The last frame that was for this motor, and when it came `[ns]`.
    pub heard: Option<(u64, Frame)>,
    /// Frames that were for this motor.
    pub n_heard: u64,
    silent: bool,
    wrong_id: bool,
    replies: FrameQueue,
}

impl Simulated {
    /// A motor of a protocol, with the settings that its drive has; `None` for a protocol that is
    /// not simulated.
    pub fn new(
        protocol: &str,
        settings: &Settings,
        common: Common,
        physics: Physics,
    ) -> Option<Simulated> {
        let mut plant = Plant::new(physics);
        let firmware = firmware(protocol, settings, common, &mut plant)?;
        Some(Simulated {
            plant,
            made_of: (protocol.to_owned(), settings.clone(), common, physics),
            firmware,
            stepped_ns: None,
            heard: None,
            n_heard: 0,
            silent: false,
            wrong_id: false,
            replies: FrameQueue::new(16),
        })
    }

    /// Its supply went away and came back: no power, no fault, and every setting as when it was
    /// new; shaft and zero stay where they are.
    pub fn reboot(&mut self) {
        let (protocol, settings, common, physics) = &self.made_of;
        let Plant { position, velocity, zero, .. } = self.plant;
        let mut plant = Plant::new(*physics);
        (plant.position, plant.velocity, plant.zero) = (position, velocity, zero);
        let kept_ns = self.plant.watchdog_ns;
        if let Some(firmware) = firmware(protocol, settings, *common, &mut plant) {
            (self.plant, self.firmware) = (plant, firmware);
            if protocol == "rmd" {
                // it is in the motor's ROM
                self.plant.watchdog_ns = kept_ns;
            }
        }
        self.replies.clear();
    }

    /// Gives a frame of the bus to the motor; its answers go to `out`. Whether it was for this
    /// motor.
    pub fn receive(&mut self, now_ns: u64, frame: &Frame, out: &mut FrameQueue) -> bool {
        self.plant.now_ns = now_ns;
        let mine = self.firmware.receive(frame, &mut self.plant, &mut self.replies);
        if mine {
            self.heard = Some((now_ns, *frame));
            self.n_heard += 1;
        }
        self.send(out);
        mine
    }

    /// Time has come to `now_ns`: the shaft turns under the torques of motor and friction, and the
    /// firmware's clocks run.
    pub fn step(&mut self, now_ns: u64, out: &mut FrameQueue) {
        let elapsed = now_ns.saturating_sub(self.stepped_ns.unwrap_or(now_ns));
        self.plant.turn(elapsed as f64 * 1e-9);
        self.tick(now_ns, out);
    }

    /// As [`Simulated::step`] for a shaft that [`Plant::carry`] turns.
    pub fn tick(&mut self, now_ns: u64, out: &mut FrameQueue) {
        self.stepped_ns = Some(now_ns);
        self.plant.now_ns = now_ns;
        self.firmware.step(&mut self.plant, &mut self.replies);
        self.send(out);
    }

    /// Its set-point, while it has power.
    pub fn follows(&self) -> Option<&Setpoint> {
        self.plant.power.then_some(&self.plant.law)
    }

    /// Injects a fault by the motor's own code: its torque is off, and it reports the code. 0
    /// removes it.
    pub fn fault(&mut self, code: u32) {
        self.plant.fault = code;
        if code != 0 {
            self.plant.power = false;
        }
    }

    /// A silent motor hears and does not answer.
    pub fn silence(&mut self, silent: bool) {
        self.silent = silent;
    }

    /// Answers under an unexpected identifier.
    pub fn answer_wrongly(&mut self, wrong: bool) {
        self.wrong_id = wrong;
    }

    fn send(&mut self, out: &mut FrameQueue) {
        for frame in self.replies.frames() {
            let mut sent = *frame;
            sent.id = match frame.id {
                id if !self.wrong_id => id,
                Id::Standard(id) => Id::Standard(id ^ 0x200),
                Id::Extended(id) => Id::Extended(id ^ 0x200),
            };
            if !self.silent {
                out.push(sent);
            }
        }
        self.replies.clear();
    }
}

/// The firmware of a protocol; `None` for one that is not simulated.
fn firmware(
    protocol: &str,
    settings: &Settings,
    common: Common,
    plant: &mut Plant,
) -> Option<Box<dyn Firmware>> {
    Some(match protocol {
        "mit" => Box::new(mit::Mit::new(settings, common, plant)),
        "cybergear" => Box::new(cybergear::CyberGear::new(settings, common, plant)),
        "odrive" => Box::new(odrive::Odrive::new(settings, common, plant)),
        "moteus" => Box::new(moteus::Moteus::new(settings, common, plant)),
        "cia402" => Box::new(cia402::Cia402::new(settings, common)),
        "rmd" => Box::new(rmd::Rmd::new(settings)),
        "vesc" => Box::new(vesc::Vesc::new(settings, common, plant)),
        "ak_servo" => Box::new(ak_servo::AkServo::new(settings, common, plant)),
        "dbc" => Box::new(dbc::Dbc::new(settings, common, plant)?),
        _ => return None,
    })
}

/// A frame with an extended identifier.
fn extended(id: u32, bytes: &[u8]) -> Option<Frame> {
    Frame::classic(Id::extended(id)?, bytes)
}

/// A standard frame of at most eight bytes; more are cut off.
fn standard(id: u32, bytes: &[u8]) -> Option<Frame> {
    Frame::classic(Id::standard(id)?, bytes)
}
