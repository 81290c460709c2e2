//! An array of which the first so many are in use; only those are saved.

/// Items in the order in which they came.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filled<T, const N: usize> {
    items: [T; N],
    count: usize,
}

impl<T: Copy + Default, const N: usize> Filled<T, N> {
    /// None in use.
    pub fn new() -> Self {
        Self { items: [T::default(); N], count: 0 }
    }

    pub fn all(&self) -> &[T] {
        self.items.get(..self.count).unwrap_or(&self.items)
    }

    pub fn get_mut(&mut self, place: usize) -> Option<&mut T> {
        self.items.get_mut(..self.count)?.get_mut(place)
    }

    pub fn last_mut(&mut self) -> Option<&mut T> {
        self.get_mut(self.count.checked_sub(1)?)
    }

    pub fn is_full(&self) -> bool {
        self.count == N
    }

    /// One more, where there is room.
    pub fn push(&mut self, item: T) {
        if let Some(place) = self.items.get_mut(self.count) {
            *place = item;
            self.count += 1;
        }
    }

    /// Leaves out so many from a place on.
    pub fn remove(&mut self, place: usize, removed: usize) {
        let place = place.min(self.count);
        let removed = removed.min(self.count - place);
        self.items.copy_within(place + removed..self.count, place);
        self.count -= removed;
    }
}

#[cfg(feature = "serde")]
impl<T: Copy + Default + serde::Serialize, const N: usize> serde::Serialize for Filled<T, N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.all())
    }
}

#[cfg(feature = "serde")]
impl<'de, T: Copy + Default + serde::Deserialize<'de>, const N: usize> serde::Deserialize<'de>
    for Filled<T, N>
{
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Few(core::marker::PhantomData))
    }
}

#[cfg(feature = "serde")]
struct Few<T, const N: usize>(core::marker::PhantomData<T>);

#[cfg(feature = "serde")]
impl<'de, T: Copy + Default + serde::Deserialize<'de>, const N: usize> serde::de::Visitor<'de> for Few<T, N> {
    type Value = Filled<T, N>;

    fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "at most {N} elements")
    }

    fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let mut filled = Filled::new();
        while let Some(element) = elements.next_element()? {
            if filled.is_full() {
                return Err(serde::de::Error::invalid_length(N + 1, &self));
            }
            filled.push(element);
        }
        Ok(filled)
    }
}
