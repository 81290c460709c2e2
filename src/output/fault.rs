//! Where tests make the disk fail. In what ships, nothing happens here.

/// Before an operation that the disk may refuse.
#[cfg(not(test))]
#[inline(always)]
pub(super) fn strike() -> std::io::Result<()> {
    Ok(())
}

/// Before a write of `length` bytes: how many of them the disk takes.
#[cfg(not(test))]
#[inline(always)]
pub(super) fn strike_write(length: usize) -> std::io::Result<usize> {
    Ok(length)
}

#[cfg(test)]
pub(super) use planned::{Fault, plan, strike, strike_write};

#[cfg(test)]
mod planned {
    use std::cell::Cell;
    use std::io::{self, ErrorKind};

    /// What goes wrong.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(crate) enum Fault {
        /// This and every later operation fails.
        Fails(ErrorKind),
        /// One write is interrupted, and every write is short.
        Hampered,
    }

    thread_local! {
        /// Operations still to go well, and the fault of the one after.
        static PLAN: Cell<Option<(u32, Fault)>> = const { Cell::new(None) };
    }

    /// The operation after `after` others fails; none: all go well from here on.
    pub(crate) fn plan(fault: Option<(u32, Fault)>) {
        PLAN.set(fault);
    }

    pub(crate) fn strike() -> io::Result<()> {
        match PLAN.get() {
            Some((0, Fault::Fails(kind))) => Err(kind.into()),
            Some((left, fault)) => {
                PLAN.set(Some((left.saturating_sub(1), fault)));
                Ok(())
            }
            None => Ok(()),
        }
    }

    pub(crate) fn strike_write(length: usize) -> io::Result<usize> {
        match PLAN.get() {
            Some((1, Fault::Hampered)) => {
                PLAN.set(Some((0, Fault::Hampered)));
                Err(ErrorKind::Interrupted.into())
            }
            Some((_, Fault::Hampered)) => {
                strike()?;
                Ok(length.min(7))
            }
            _ => strike().map(|()| length),
        }
    }
}
