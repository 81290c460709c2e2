use crate::Rig;
use crate::trace::LineLayout;
use std::borrow::Cow;

/// Sets of names that are remembered with what they mean.
const LAYOUTS: usize = 16;

/// What sets of names mean, the last used first.
#[derive(Default)]
pub(super) struct Layouts(Vec<(String, Vec<String>, LineLayout)>);

impl Layouts {
    /// What cells of these names mean to a rig.
    pub(super) fn find(&mut self, names: &[Cow<'_, str>], rig: &Rig) -> Result<&LineLayout, String> {
        let known = self.0.iter().position(|(rig_name, known, _)| *rig_name == rig.name && known == names);
        match known {
            Some(0) => {}
            Some(at) => self.0.swap(0, at),
            None => {
                let names: Vec<String> = names.iter().map(|name| name.clone().into_owned()).collect();
                let layout = LineLayout::new(&names, rig).map_err(|fault| fault.to_string())?;
                self.0.insert(0, (rig.name.clone(), names, layout));
                self.0.truncate(LAYOUTS);
            }
        }
        self.0.first().map(|(_, _, layout)| layout).ok_or_else(String::new)
    }
}
