//! Clients that come and go where the answering thread gets no processor.

use std::fs;

use rtrb::RingBuffer;
use sarrus_proto::board::class_of;
use sarrus_proto::{Domain, ServerName};

use super::*;

#[test]
fn a_lane_is_granted_while_that_of_a_dead_client_is_on_its_way_back() {
    let root = std::env::temp_dir().join(format!("sarrus-places-{}", std::process::id()));
    let domain = Domain::at(&root).unwrap();
    let run = Run::start(&domain, &ServerName::new("places").unwrap()).unwrap();
    let places = Connections::places(1);
    let (orders_in, mut orders) = RingBuffer::new(3 * places);
    let (mut retired, retired_out) = RingBuffer::new(2 * places);
    let mut connections = Connections::new(run.listen().unwrap(), 1, orders_in, retired_out);
    let _clients = [0; 3].map(|_| ControlSocket::connect(run.name_folder()).unwrap());
    connections.wait(Duration::ZERO);
    let classes = [class_of(1).unwrap(); 2];

    connections.make_lane(&run, 1, classes).unwrap();
    let no_lane = Err(Refusal::NoLane { limit: 1 });
    assert_eq!(connections.make_lane(&run, 2, classes), no_lane);
    connections.close(1);
    connections.make_lane(&run, 2, classes).unwrap();
    // and makes no room for a second one
    assert_eq!(connections.make_lane(&run, 3, classes), no_lane);

    // the answering thread at last
    connections.close(2);
    let mut served = Vec::new();
    while let Ok(order) = orders.pop() {
        match order {
            Order::Serve { place, end } => served.push((place, end)),
            Order::Retire { place } => {
                let index = served.iter().position(|(one, _)| *one == place).unwrap();
                assert!(retired.push(served.swap_remove(index)).is_ok());
            }
        }
    }
    connections.collect();
    assert!(served.is_empty() && connections.places.iter().all(Option::is_none));
    drop((connections, run));
    domain.tidy();
    assert!(!fs::exists(root).unwrap());
}
