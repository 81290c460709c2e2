use crate::broker::Inbound;
use crate::saver::Saved;

/// What wakes the service.
#[derive(Debug)]
pub enum Input {
    Broker(Inbound),
    Saved(Saved),
    /// A signal to end.
    Stop,
}
