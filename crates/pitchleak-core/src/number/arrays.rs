//! serde for arrays of generic length, which it does not know itself: as tuples, without an allocator.

use core::fmt;
use core::marker::PhantomData;
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// An array as a tuple.
#[derive(Clone, Copy)]
struct Row<T, const N: usize>([T; N]);

impl<T: Serialize, const N: usize> Serialize for Row<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize_all(&self.0, serializer)
    }
}

impl<'de, T: Deserialize<'de> + Default + Copy, const N: usize> Deserialize<'de> for Row<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_tuple(N, Elements(PhantomData)).map(Self)
    }
}

impl<T: Default + Copy, const N: usize> Default for Row<T, N> {
    fn default() -> Self {
        Self([T::default(); N])
    }
}

struct Elements<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de> + Default + Copy, const N: usize> Visitor<'de> for Elements<T, N> {
    type Value = [T; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{N} elements")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<[T; N], A::Error> {
        let mut array = [T::default(); N];
        for (index, slot) in array.iter_mut().enumerate() {
            *slot = elements.next_element()?.ok_or_else(|| A::Error::invalid_length(index, &self))?;
        }
        Ok(array)
    }
}

fn serialize_all<S: Serializer, T: Serialize>(elements: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(elements.len())?;
    elements.iter().try_for_each(|element| tuple.serialize_element(element))?;
    tuple.end()
}

/// `#[serde(with)]` for `[T; N]`.
pub(crate) mod vector {
    use super::{Deserialize, Deserializer, Row, Serialize, Serializer, serialize_all};

    pub fn serialize<S: Serializer, T: Serialize, const N: usize>(
        array: &[T; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serialize_all(array, serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default + Copy, const N: usize>(
        deserializer: D,
    ) -> Result<[T; N], D::Error> {
        Row::deserialize(deserializer).map(|row| row.0)
    }
}

/// `#[serde(with)]` for `[[T; N]; M]`.
pub(crate) mod matrix {
    use super::{Deserialize, Deserializer, Row, Serialize, Serializer};

    pub fn serialize<S: Serializer, T: Serialize + Copy, const N: usize, const M: usize>(
        array: &[[T; N]; M],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        Row(array.map(Row)).serialize(serializer)
    }

    pub fn deserialize<
        'de,
        D: Deserializer<'de>,
        T: Deserialize<'de> + Default + Copy,
        const N: usize,
        const M: usize,
    >(
        deserializer: D,
    ) -> Result<[[T; N]; M], D::Error> {
        Row::<Row<T, N>, M>::deserialize(deserializer).map(|rows| rows.0.map(|row| row.0))
    }
}
