//! JSON as nearly every sender writes it: objects of numbers, nulls and strings without escapes, alone or in an array.
//! Anything else, and whatever is no JSON, is left to serde_json; what is read here is what serde_json would read.

use super::format::{Fields, ROOM};
use std::borrow::Cow;

/// The members of one object.
pub(super) fn object(text: &str) -> Option<Fields<'_>> {
    let mut rest = Rest { text, at: 0, room: ROOM };
    let fields = rest.object()?;
    rest.ends().then_some(fields)
}

/// Those of every object of an array.
pub(super) fn array(text: &str) -> Option<Vec<Fields<'_>>> {
    let mut rest = Rest { text, at: 0, room: ROOM };
    rest.take(b'[')?;
    let mut objects = vec![rest.object()?];
    while rest.take(b',').is_some() {
        objects.push(rest.object()?);
    }
    rest.take(b']')?;
    rest.ends().then_some(objects)
}

/// What is still to be read.
struct Rest<'a> {
    text: &'a str,
    at: usize,
    /// Members of the object before: those of the next.
    room: usize,
}

impl<'a> Rest<'a> {
    #[inline]
    fn byte(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    #[inline]
    fn blanks(&mut self) {
        while matches!(self.byte(), Some(b' ' | b'\n' | b'\r' | b'\t')) {
            self.at += 1;
        }
    }

    /// Passes over this sign and blanks before it.
    #[inline]
    fn take(&mut self, sign: u8) -> Option<()> {
        self.blanks();
        self.pass(sign)
    }

    #[inline]
    fn pass(&mut self, sign: u8) -> Option<()> {
        (self.byte() == Some(sign)).then(|| self.at += 1)
    }

    fn ends(&mut self) -> bool {
        self.blanks();
        self.at == self.text.len()
    }

    fn object(&mut self) -> Option<Fields<'a>> {
        self.take(b'{')?;
        let mut fields = Fields::with_room(self.room);
        loop {
            self.blanks();
            let name = self.string()?;
            self.take(b':')?;
            self.blanks();
            fields.push(Cow::Borrowed(name), Cow::Borrowed(self.value()?));
            if self.take(b',').is_none() {
                self.take(b'}')?;
                self.room = fields.names.len();
                return Some(fields);
            }
        }
    }

    fn value(&mut self) -> Option<&'a str> {
        match self.byte()? {
            b'"' => self.string(),
            b'n' => {
                self.at += "null".len();
                (self.text.get(self.at - "null".len()..self.at)? == "null").then_some("")
            }
            _ => self.number(),
        }
    }

    /// Between quotes.
    #[inline]
    fn string(&mut self) -> Option<&'a str> {
        self.pass(b'"')?;
        let begin = self.at;
        loop {
            match self.byte()? {
                b'"' => break,
                b'\\' | 0..b' ' => return None,
                _ => self.at += 1,
            }
        }
        self.at += 1;
        self.text.get(begin..self.at - 1)
    }

    #[inline]
    fn number(&mut self) -> Option<&'a str> {
        let begin = self.at;
        let _ = self.pass(b'-');
        // A leading zero stands alone.
        self.pass(b'0').or_else(|| self.digits())?;
        if self.pass(b'.').is_some() {
            self.digits()?;
        }
        if self.pass(b'e').or_else(|| self.pass(b'E')).is_some() {
            let _ = self.pass(b'+').or_else(|| self.pass(b'-'));
            self.digits()?;
        }
        self.text.get(begin..self.at)
    }

    /// One at least.
    #[inline]
    fn digits(&mut self) -> Option<()> {
        let begin = self.at;
        while self.byte().is_some_and(|byte| byte.is_ascii_digit()) {
            self.at += 1;
        }
        (self.at > begin).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_sample_is_read_without_help() {
        let text = r#" [ {"cylinder":"T7/B2", "t_s" : 0.10, "x_mm": -4e+1,"qa_lpm":null} , {"t_s":1} ] "#;
        let [first, second] = array(text).unwrap().try_into().unwrap();
        assert_eq!(first.cylinder, "T7/B2");
        assert_eq!(first.names, ["t_s", "x_mm", "qa_lpm"]);
        assert_eq!(first.cells, ["0.10", "-4e+1", ""]);
        assert_eq!(object(r#"{"t_s":1}"#), Some(second));
    }

    proptest! {
        /// Also of texts that are nearly JSON.
        #[test]
        fn what_is_read_is_what_serde_json_reads(
            parts in proptest::collection::vec(
                prop_oneof![
                    r#"[\[\]{}:,"\\ \n.eE0-9+-]"#,
                    r#""[a-z\\é\t]{0,3}""#,
                    "-?(0|[0-9]{1,3})(\\.[0-9]{0,3})?([eE][+-]?[0-9]{0,2})?",
                    Just("null".to_owned()),
                    Just("nul".to_owned()),
                    Just("true".to_owned()),
                    Just(r#"{"a":1,"b":"x"}"#.to_owned()),
                    Just(r#"{"t_s":"#.to_owned()),
                ],
                0..8,
            )
        ) {
            let inner = parts.concat();
            for text in [inner.clone(), format!("{{\"a\":{inner}}}"), format!("[{{\"a\":{inner}}}]"), format!("[{inner}]")] {
                if let Some(fields) = object(&text) {
                    prop_assert_eq!(serde_json::from_str::<Fields<'_>>(&text).unwrap(), fields);
                }
                if let Some(all) = array(&text) {
                    prop_assert_eq!(serde_json::from_str::<Vec<Fields<'_>>>(&text).unwrap(), all);
                }
            }
        }
    }
}
