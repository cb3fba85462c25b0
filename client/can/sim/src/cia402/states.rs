//! The state machine of CiA 402.

/// States of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum State {
    #[default]
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    QuickStop,
    Fault,
}

/// A drive between control word (6040) and status word (6041).
#[derive(Debug, Default)]
pub(super) struct Drive {
    pub(super) state: State,
    /// The fault reset bit of the last control word: it works on its rising edge.
    reset: bool,
}

impl Drive {
    /// Takes a control word; true when it resets a fault.
    pub(super) fn control(&mut self, word: u16) -> bool {
        let reset = word & 0x80 != 0 && !self.reset;
        self.reset = word & 0x80 != 0;
        if self.state == State::Fault {
            if reset {
                self.state = State::SwitchOnDisabled;
            }
            return reset;
        }
        // bits: 0 switch on, 1 enable voltage, 2 quick stop (when 0), 3 enable operation
        self.state = match (self.state, word & 0x0F) {
            (_, bits) if bits & 0x02 == 0 => State::SwitchOnDisabled,
            (State::OperationEnabled | State::QuickStop, bits) if bits & 0x04 == 0 => {
                State::QuickStop
            }
            (_, bits) if bits & 0x04 == 0 => State::SwitchOnDisabled,
            (State::QuickStop, _) => State::QuickStop,
            (_, 0x06 | 0x0E) => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn, 0x07) => State::SwitchedOn,
            (State::ReadyToSwitchOn | State::SwitchedOn | State::OperationEnabled, 0x0F) => {
                State::OperationEnabled
            }
            (State::OperationEnabled, 0x07) => State::SwitchedOn,
            (state, _) => state,
        };
        false
    }

    pub(super) fn fault(&mut self) {
        self.state = State::Fault;
    }

    pub(super) fn disable(&mut self) {
        if self.state != State::Fault {
            self.state = State::SwitchOnDisabled;
        }
    }

    pub(super) fn quick_stop(&mut self) {
        if self.state == State::OperationEnabled {
            self.state = State::QuickStop;
        }
    }

    /// The status word: the state, voltage enabled, and remote.
    pub(super) fn status_word(&self) -> u16 {
        let state = match self.state {
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStop => 0x07,
            State::Fault => 0x08,
        };
        state | 0x0210
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(words: &[u16]) -> State {
        let mut drive = Drive::default();
        for word in words {
            drive.control(*word);
        }
        drive.state
    }

    #[test]
    fn the_way_to_operation_has_three_steps() {
        assert_eq!(after(&[0x06]), State::ReadyToSwitchOn);
        assert_eq!(after(&[0x06, 0x07]), State::SwitchedOn);
        assert_eq!(after(&[0x06, 0x07, 0x0F]), State::OperationEnabled);
        assert_eq!(after(&[0x0F]), State::SwitchOnDisabled);
        assert_eq!(after(&[0x07, 0x0F]), State::SwitchOnDisabled);
    }

    #[test]
    fn every_way_down_is_one_step() {
        let up = [0x06, 0x07, 0x0F];
        let then = |word: u16| after(&[&up[..], &[word]].concat());
        assert_eq!(then(0x00), State::SwitchOnDisabled);
        assert_eq!(then(0x06), State::ReadyToSwitchOn);
        assert_eq!(then(0x07), State::SwitchedOn);
        assert_eq!(then(0x02), State::QuickStop);
    }

    #[test]
    fn a_fault_stays_until_the_rising_edge_of_its_reset() {
        let mut drive = Drive::default();
        drive.control(0x80);
        drive.fault();
        assert!(!drive.control(0x80));
        assert!(!drive.control(0x0F));
        assert_eq!(drive.state, State::Fault);
        assert!(drive.control(0x80));
        assert_eq!(drive.state, State::SwitchOnDisabled);
    }
}
