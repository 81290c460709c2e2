//! Rows with flows other than were read: of the cylinder as it would be.

use super::columns::Layout;
use super::error::TraceFault;
use super::row::{Next, Row, RowSource};
use crate::signal::Signal;

/// Readings of flow, m³/s, from the time, s, the pressures, Pa, and the flows that were read, those of A first.
pub type FlowChange<'a> = Box<dyn FnMut(f64, [f64; 2], [f64; 2]) -> [f64; 2] + Send + 'a>;

pub(super) struct ChangedFlows<'a> {
    pub(super) rows: Box<dyn RowSource + Send + 'a>,
    pub(super) change: FlowChange<'a>,
}

impl RowSource for ChangedFlows<'_> {
    fn layout(&self) -> &Layout {
        self.rows.layout()
    }

    fn epoch_ns(&self) -> Option<i64> {
        self.rows.epoch_ns()
    }

    fn count_from(&mut self, rows: u64) {
        self.rows.count_from(rows);
    }

    fn next_row(&mut self, row: &mut Row) -> Result<Next, TraceFault> {
        let next = self.rows.next_row(row)?;
        if let Next::Row = next {
            let of = |a, b| [row.get(a), row.get(b)];
            let pressures_pa = of(Signal::PressureA, Signal::PressureB);
            let flows_m3s = of(Signal::FlowA, Signal::FlowB);
            let [qa, qb] = (self.change)(row.get(Signal::Time), pressures_pa, flows_m3s);
            // A flow that was not read stays so: no number is made of none.
            row.set(Signal::FlowA, qa);
            row.set(Signal::FlowB, qb);
        }
        Ok(next)
    }
}
