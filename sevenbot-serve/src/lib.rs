//! One arm for many programs: requests of all clients share the arm's line, and each client sees an arm of its own.
//!
//! ```text
//!   bytes ──▶ FrameClient ──▶ Hub ──▶ Line ──▶ frames to the arm
//!   bytes ◀── FrameClient ◀── Hub ◀── Line ◀── bytes of the arm
//! ```
//!
//! The hub and the clients read no clock and open no port: time and bytes are arguments. [`server`] connects them to a
//! serial port, pseudo-terminals and sockets.
//!
//! Two programs share a simulated arm. The loop is a shell in virtual time:
//!
//! ```
//! use arm_sim::flash::Flash;
//! use arm_sim::plant::Plant;
//! use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
//! use protocol_core::time::{Duration, Instant};
//! use sevenbot_serve::hub::HubOptions;
//! use sevenbot_serve::{FrameClient, Hub};
//!
//! let mut now = Instant::ZERO;
//! let config = ArmConfig { chip_id: *b"EXAMPL", is_paced: true, torque_codes: Default::default() };
//! let mut arm = SimulatedArm::new(now, config, Flash::in_memory(), Plant::new(now));
//! let mut hub = Hub::new(115_200, HubOptions::default());
//! hub.open_arm(now);
//! let mut run = |hub: &mut Hub, clients: &mut [FrameClient], millis: u64| {
//!     for _ in 0..millis {
//!         now = now + Duration::from_millis(1);
//!         hub.poll(now);
//!         let sent = arm.host_send(now, hub.to_arm());
//!         hub.sent_to_arm(sent);
//!         arm.advance(now, true);
//!         hub.arm_bytes(now, arm.host_received());
//!         arm.host_take(arm.host_received().len());
//!         clients.iter_mut().for_each(|client| client.collect(hub));
//!     }
//!     now
//! };
//! let now = run(&mut hub, &mut [], 1_000);
//! assert!(hub.has_arm());
//!
//! // Each program reads registers, and gets its own reply.
//! let mut clients = [FrameClient::connect(&mut hub, 115_200), FrameClient::connect(&mut hub, 115_200)];
//! let requests = [[0xAA, 0x77, 3, 46, 7, 0x8B, 0xCE], [0xAA, 0x77, 3, 0, 1, 0x16, 0x6C]];
//! for (client, request) in clients.iter_mut().zip(&requests) {
//!     client.push(&mut hub, now, now, request);
//! }
//! run(&mut hub, &mut clients, 100);
//! assert_eq!(clients[0].output()[..12], [0xAA, 0x77, 3, 46, 7, 90, 90, 65, 90, 90, 90, 80]);
//! assert_eq!(clients[1].output()[..6], [0xAA, 0x77, 3, 0, 1, 7]);
//! ```

#![forbid(unsafe_code)]

pub mod frame_client;
pub mod hub;
pub mod maker;
pub mod server;
mod token;

pub use frame_client::FrameClient;
pub use hub::{ClientId, Hub, HubEvent, WholeRequest};
pub use maker::MakerClient;
