use super::{Channel, Problem, Run, bare_unit, latin1};

/// How a binary file stores its samples: the two-byte id it begins with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// 1: 16-bit channels, 32-bit time.
    CompressedWithTime,
    /// 2: 16-bit channels, time by first value and step.
    Compressed,
    /// 3: 64-bit channels, time by first value and step.
    Uncompressed,
    /// 4: as 2, with the length of the channel names in the header.
    CompressedNamed,
}

impl Layout {
    fn of_id(id: i16) -> Result<Self, Problem> {
        match id {
            1 => Ok(Self::CompressedWithTime),
            2 => Ok(Self::Compressed),
            3 => Ok(Self::Uncompressed),
            4 => Ok(Self::CompressedNamed),
            _ => Err(Problem::FileId(id)),
        }
    }
}

/// Length of a channel name where the header gives none, `ChanLen` of WrBinFAST.
const DEFAULT_NAME_LENGTH: usize = 10;

/// Parses a binary output file.
///
/// Every count is held against the bytes that are left before memory is asked for.
pub(super) fn parse(bytes: &[u8]) -> Result<Run, Problem> {
    let mut cursor = Cursor { rest: bytes, length: bytes.len() };
    let layout = Layout::of_id(cursor.i16("file id")?)?;
    let name_length = match layout {
        Layout::CompressedNamed => positive("length of channel names", cursor.i16("header")?.into())?,
        _ => DEFAULT_NAME_LENGTH,
    };
    let channels = positive("number of channels", cursor.i32("header")?.into())?;
    let samples = not_negative("number of samples", cursor.i32("header")?.into())?;
    // Of packed time the scale and offset, else the first value and the step, s.
    let (time_first, time_second) = (cursor.f64("header")?, cursor.f64("header")?);
    let scaling = match layout {
        Layout::Uncompressed => Vec::new(),
        _ => {
            let scales = cursor.array(channels, "channel scales", f32::from_le_bytes)?;
            let offsets = cursor.array(channels, "channel offsets", f32::from_le_bytes)?;
            scales.into_iter().zip(offsets).collect()
        }
    };
    let description_length = not_negative("length of the description", cursor.i32("header")?.into())?;
    let description = latin1(cursor.take(description_length, "description")?).trim().to_owned();
    let mut channels = named_channels(&mut cursor, channels, name_length)?;
    let packed_time = match layout {
        Layout::CompressedWithTime => Some(cursor.array(samples, "time", i32::from_le_bytes)?),
        _ => None,
    };
    if layout == Layout::Uncompressed {
        uncompressed(&mut cursor, &mut channels, samples)?;
    } else {
        compressed(&mut cursor, &mut channels, &scaling, samples)?;
    }
    // Only now is `samples` known to be backed by that many rows.
    let time_s = match packed_time {
        Some(packed) => unpacked_time(&packed, time_first, time_second)?,
        None => (0..samples).map(|k| time_first + time_second * k as f64).collect(),
    };
    Ok(Run { description, time_s, channels })
}

fn unpacked_time(packed: &[i32], scale: f64, offset: f64) -> Result<Vec<f64>, Problem> {
    if scale == 0.0 || !scale.is_finite() || !offset.is_finite() {
        return Err(Problem::Scale { channel: "Time".into() });
    }
    Ok(packed.iter().map(|&p| (f64::from(p) - offset) / scale).collect())
}

/// The names, then the units, of time and of every channel.
fn named_channels(cursor: &mut Cursor, count: usize, length: usize) -> Result<Vec<Channel>, Problem> {
    cursor.take(length, "channel names")?;
    let names = cursor.records(count, length, "channel names")?;
    cursor.take(length, "channel units")?;
    let units = cursor.records(count, length, "channel units")?;
    let text = |record| latin1(record).trim().to_owned();
    Ok(names
        .zip(units)
        .map(|(name, unit)| Channel { name: text(name), unit: bare_unit(&latin1(unit)), values: Vec::new() })
        .collect())
}

fn uncompressed(cursor: &mut Cursor, channels: &mut [Channel], samples: usize) -> Result<(), Problem> {
    let cells = samples.saturating_mul(channels.len());
    let data = cursor.array(cells, "samples", f64::from_le_bytes)?;
    let count = channels.len();
    for (column, channel) in channels.iter_mut().enumerate() {
        channel.values = data.iter().skip(column).step_by(count).copied().collect();
    }
    Ok(())
}

fn compressed(
    cursor: &mut Cursor,
    channels: &mut [Channel],
    scaling: &[(f32, f32)],
    samples: usize,
) -> Result<(), Problem> {
    let cells = samples.saturating_mul(channels.len());
    let data = cursor.array(cells, "samples", i16::from_le_bytes)?;
    let count = channels.len();
    for (column, (channel, &(scale, offset))) in channels.iter_mut().zip(scaling).enumerate() {
        if scale == 0.0 || !scale.is_finite() || !offset.is_finite() {
            return Err(Problem::Scale { channel: channel.name.clone() });
        }
        let value = |&packed: &i16| (f64::from(packed) - f64::from(offset)) / f64::from(scale);
        channel.values = data.iter().skip(column).step_by(count).map(value).collect();
    }
    Ok(())
}

fn positive(part: &'static str, value: i64) -> Result<usize, Problem> {
    match not_negative(part, value)? {
        0 => Err(Problem::Count { part, value }),
        count => Ok(count),
    }
}

fn not_negative(part: &'static str, value: i64) -> Result<usize, Problem> {
    usize::try_from(value).map_err(|_| Problem::Count { part, value })
}

/// What is left of the file.
struct Cursor<'a> {
    rest: &'a [u8],
    length: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize, part: &'static str) -> Result<&'a [u8], Problem> {
        let (head, rest) =
            self.rest.split_at_checked(count).ok_or(Problem::Truncated { part, length: self.length })?;
        self.rest = rest;
        Ok(head)
    }

    fn records(
        &mut self,
        count: usize,
        length: usize,
        part: &'static str,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, Problem> {
        let total = count.saturating_mul(length);
        Ok(self.take(total, part)?.chunks_exact(length))
    }

    fn array<T, const N: usize>(
        &mut self,
        count: usize,
        part: &'static str,
        from_le: fn([u8; N]) -> T,
    ) -> Result<Vec<T>, Problem> {
        let (chunks, _) = self.take(count.saturating_mul(N), part)?.as_chunks::<N>();
        Ok(chunks.iter().copied().map(from_le).collect())
    }

    fn one<T, const N: usize>(
        &mut self,
        part: &'static str,
        from_le: fn([u8; N]) -> T,
    ) -> Result<T, Problem> {
        let length = self.length;
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or(Problem::Truncated { part, length })?;
        self.rest = rest;
        Ok(from_le(*head))
    }

    fn i16(&mut self, part: &'static str) -> Result<i16, Problem> {
        self.one(part, i16::from_le_bytes)
    }

    fn i32(&mut self, part: &'static str) -> Result<i32, Problem> {
        self.one(part, i32::from_le_bytes)
    }

    fn f64(&mut self, part: &'static str) -> Result<f64, Problem> {
        self.one(part, f64::from_le_bytes)
    }
}
