use crate::broker::Inbound;
use crate::saver::Saved;

/// What wakes the service.
pub enum Input {
    Broker(Inbound),
    Saved(Box<Saved>),
    /// A signal to end.
    Stop,
    /// A signal to read the configuration again.
    Reload,
}
