//! The gallery of effects: a page for each entry of the table of effects, with its residual in some wind.
//!
//! ```text
//! cargo run --release --example gallery -- FOLDER
//! ```
//!
//! Writes `ID.md` and `ID.svg` for each effect, and prints a line with file, title and cause of each page; `ci/book.py`
//! makes a chapter of them.

mod case;
mod page;

use case::{Case, Wind};
use pitchleak::core::Effect;
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

/// What can be said beside an answer that comes from several threads.
type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let folder = std::env::args().nth(1).ok_or("say where the pages go: FOLDER")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let winds = [Wind::at_constant_temperature()?, Wind::with_warming_oil()?];
    let write = |effect: &Effect| -> Result<(), Failure> {
        let [constant, warming] = &winds;
        let case = Case::of(*effect, if case::follows_temperature(*effect) { warming } else { constant })?;
        let id = effect.spec().id;
        std::fs::write(folder.join(format!("{id}.svg")), page::figure(&case)?)?;
        std::fs::write(folder.join(format!("{id}.md")), page::text(&case))?;
        Ok(())
    };
    Effect::ALL.par_iter().map(write).collect::<Result<(), _>>()?;
    for effect in Effect::ALL {
        let spec = effect.spec();
        println!("{}.md\t{}\t{}", spec.id, page::title(*effect), spec.cause);
    }
    Ok(())
}
