//! Sessions on displays without a headset, against pictures of the same poses that were deformed and packed here, without lanes.

mod attendance;
mod people;
mod stage;
mod stills;
