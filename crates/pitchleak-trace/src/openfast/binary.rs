use super::{Channel, Problem, Run, bare_unit, latin1};

/// Ids, the two bytes that a file begins with. 1: 16-bit channels, 32-bit time; 2: time by first value and step; 3: 64-bit
/// channels; 4: as 2, with the length of the channel names in the header.
const WITH_TIME: i16 = 1;
const UNCOMPRESSED: i16 = 3;
const NAMED: i16 = 4;

/// Length of a channel name where the header gives none, `ChanLen` of WrBinFAST.
const DEFAULT_NAME_LENGTH: usize = 10;

/// Parses a binary output file.
///
/// Every count is held against the bytes that are left before memory is asked for.
pub(super) fn parse(bytes: &[u8]) -> Result<Run, Problem> {
    let mut cursor = Cursor { rest: bytes, length: bytes.len() };
    let id = cursor.one("file id", i16::from_le_bytes)?;
    if !(1..=4).contains(&id) {
        return Err(Problem::FileId(id));
    }
    let name_length = match id {
        NAMED => positive("length of channel names", cursor.one("header", i16::from_le_bytes)?.into())?,
        _ => DEFAULT_NAME_LENGTH,
    };
    let count = positive("number of channels", cursor.i32("header")?.into())?;
    let samples = not_negative("number of samples", cursor.i32("header")?.into())?;
    // Of packed time the scale and offset, else the first value and the step, s.
    let (time_first, time_second) = (cursor.f64("header")?, cursor.f64("header")?);
    let scaling = match id {
        UNCOMPRESSED => None,
        _ => Some([
            cursor.array(count, "channel scales", f32::from_le_bytes)?,
            cursor.array(count, "channel offsets", f32::from_le_bytes)?,
        ]),
    };
    let description_length = not_negative("length of the description", cursor.i32("header")?.into())?;
    let description = latin1(cursor.take(description_length, "description")?).trim().to_owned();
    let mut channels = named_channels(&mut cursor, count, name_length)?;
    let packed_time = match id {
        WITH_TIME => Some(cursor.array(samples, "time", |bytes| i32::from_le_bytes(bytes).into())?),
        _ => None,
    };
    let columns = match scaling {
        Some(_) => columns(&mut cursor, count, samples, |bytes| i16::from_le_bytes(bytes).into())?,
        None => columns(&mut cursor, count, samples, f64::from_le_bytes)?,
    };
    channels.iter_mut().zip(columns).for_each(|(channel, values)| channel.values = values);
    if let Some([scales, offsets]) = scaling {
        for (Channel { name, values, .. }, (scale, offset)) in
            channels.iter_mut().zip(scales.into_iter().zip(offsets))
        {
            unpack(values, scale.into(), offset.into(), name)?;
        }
    }
    // Only now is `samples` known to be backed by that many rows.
    let time_s = match packed_time {
        Some(mut time_s) => {
            unpack(&mut time_s, time_first, time_second, "Time")?;
            time_s
        }
        None => (0..samples).map(|k| time_first + time_second * k as f64).collect(),
    };
    Ok(Run { description, time_s, channels })
}

/// Numbers of which the file has scale and offset.
fn unpack(values: &mut [f64], scale: f64, offset: f64, channel: &str) -> Result<(), Problem> {
    if scale == 0.0 || !scale.is_finite() || !offset.is_finite() {
        return Err(Problem::Scale { channel: channel.to_owned() });
    }
    values.iter_mut().for_each(|value| *value = (*value - offset) / scale);
    Ok(())
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

/// The samples of each channel; in the file those of one time stand together.
fn columns<const N: usize>(
    cursor: &mut Cursor,
    count: usize,
    samples: usize,
    from_le: fn([u8; N]) -> f64,
) -> Result<Vec<Vec<f64>>, Problem> {
    let data = cursor.array(samples.saturating_mul(count), "samples", from_le)?;
    let column = |column| data.iter().skip(column).step_by(count).copied().collect();
    Ok((0..count).map(column).collect())
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

    fn i32(&mut self, part: &'static str) -> Result<i32, Problem> {
        self.one(part, i32::from_le_bytes)
    }

    fn f64(&mut self, part: &'static str) -> Result<f64, Problem> {
        self.one(part, f64::from_le_bytes)
    }
}
