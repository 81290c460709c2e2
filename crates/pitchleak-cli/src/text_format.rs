//! The arguments that settle how a text file of numbers is written, where the file leaves it open.

use clap::Args;
use pitchleak::Rig;
use pitchleak::rig::{Decimal, Delimiter};
use pitchleak::times::{TimeFormat, TimeKind};

#[derive(Args)]
#[command(next_help_heading = "Where a file leaves it open")]
pub struct TextFormat {
    /// What stands between cells: comma, semicolon, tab or bar
    #[arg(long, value_name = "NAME", value_parser = delimiter)]
    delimiter: Option<Delimiter>,

    /// What stands before decimals: point or comma
    #[arg(long, value_name = "NAME", value_parser = decimal)]
    decimal: Option<Decimal>,

    /// How times are written: iso, dmy, mdy, ymd, hms, epoch s|ms|us|ns, excel, or a pattern (%d.%m.%Y %H:%M:%S%.f)
    #[arg(long, value_name = "FORMAT", value_parser = time)]
    time_format: Option<TimeKind>,
}

fn delimiter(name: &str) -> Result<Delimiter, String> {
    let names = Delimiter::NAMES.map(|(name, _)| name).join(", ");
    Delimiter::by_name(name).ok_or_else(|| format!("one of: {names}"))
}

fn decimal(name: &str) -> Result<Decimal, String> {
    Decimal::by_name(name).ok_or_else(|| "one of: point, comma".to_owned())
}

fn time(name: &str) -> Result<TimeKind, String> {
    TimeKind::by_name(name).ok_or_else(|| format!("one of: {}", TimeKind::ALLOWED))
}

impl TextFormat {
    /// What is given comes before what the rig file says.
    pub fn settle(&self, rig: &mut Rig) {
        let csv = &mut rig.csv;
        csv.delimiter = self.delimiter.or(csv.delimiter);
        csv.decimal = self.decimal.or(csv.decimal);
        if let Some(kind) = &self.time_format {
            let zone = csv.time.take().and_then(|time| time.zone);
            csv.time = Some(TimeFormat { kind: kind.clone(), zone });
        }
    }
}
