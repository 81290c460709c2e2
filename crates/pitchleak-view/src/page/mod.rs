//! Reports as one page that needs nothing else: no network, no other file, no program but a browser.
//!
//! A page is written text first (status, sentence, next step), then charts, drawn by uPlot from numbers in the page, each with
//! a table. Every name from a file is escaped by the templates; a content security policy lets nothing run but the
//! page's own script, known by its hash.

pub mod chart;
mod check;
mod cylinders;
mod diagnose;
pub mod drawing;
mod fleet;
mod history;
pub mod machine;
mod proof;
mod replay;

pub use history::History;

use base64::Engine;
use chart::Charts;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use pitchleak::output::{Inputs, OutputError, OutputFile};
use pitchleak::report::Status;
use sha2::{Digest, Sha256};
use std::path::Path;

const SCRIPT: &str = concat!(
    include_str!("assets/uplot/uPlot.iife.min.js"),
    "\n",
    include_str!("assets/page.js"),
    "\n",
    include_str!("assets/print.js")
);
const STYLE: &str = concat!(
    include_str!("assets/uplot/uPlot.min.css"),
    "\n",
    include_str!("assets/page.css"),
    "\n",
    include_str!("assets/drawing.css")
);
const UPLOT_LICENCE: &str = include_str!("assets/uplot/LICENSE");

/// A report for people, as an HTML page.
pub struct Page {
    /// What made it: `replay`, `diagnose` and so on.
    pub kind: &'static str,
    /// What it is about: the trace's name.
    pub subject: String,
    /// The first screen.
    pub head: Head,
    /// Sections in their order.
    pub sections: Vec<Section>,
    /// What the page's script draws.
    pub charts: Charts,
}

/// What a reader sees first.
pub struct Head {
    /// The status in a word.
    pub word: String,
    /// Its colour.
    pub tone: Tone,
    /// What it says.
    pub sentence: String,
    /// One line on what was read.
    pub data: String,
    /// What to do, what stays open, and the figures in brief.
    pub cards: Vec<Card>,
}

/// How a status is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Red.
    Leak,
    /// Green.
    Sound,
    /// Amber.
    Caution,
}

/// A box of the first screen.
pub struct Card {
    /// Above it.
    pub title: &'static str,
    /// What it holds.
    pub body: Markup,
}

/// A section below the first screen.
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    /// Above it.
    pub title: &'static str,
    /// What it holds.
    pub body: Markup,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Leak => "is-leak",
            Self::Sound => "is-sound",
            Self::Caution => "is-caution",
        }
    }
}

impl From<Status> for Tone {
    fn from(status: Status) -> Self {
        match status {
            Status::Leak => Self::Leak,
            Status::Sound => Self::Sound,
            Status::Doubtful | Status::NotSure => Self::Caution,
        }
    }
}

impl Page {
    /// The page.
    pub fn to_html(&self) -> String {
        let title = format!("{} – {} – pitchleak {}", self.head.word, self.subject, self.kind);
        html! {
            (DOCTYPE)
            html .no-script lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(policy());
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="generator" content=(generator());
                    title { (title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    (self.header())
                    main {
                        @for section in &self.sections {
                            section id=(section.id) aria-labelledby={ (section.id) "-title" } {
                                h2 id={ (section.id) "-title" } { (section.title) }
                                (section.body)
                            }
                        }
                    }
                    (legend())
                    (footer())
                    script #data type="application/json" { (PreEscaped(self.charts.to_json())) }
                    script { (PreEscaped(SCRIPT)) }
                }
            }
        }
        .into_string()
    }

    fn header(&self) -> Markup {
        let Head { word, tone, sentence, data, cards } = &self.head;
        html! {
            header {
                p .where { "pitchleak " (self.kind) ": " bdi { (self.subject) } ", " (data) }
                h1 class=(tone.class()) { (word) }
                p .sentence { (machine::prose(sentence)) }
                div .first {
                    @for card in cards { section .card { h2 { (card.title) } (card.body) } }
                }
                nav aria-label="Sections" {
                    @for section in &self.sections { a href={ "#" (section.id) } { (section.title) } " " }
                }
            }
        }
    }
}

/// Why a page is not written.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// Another name than a page has.
    #[error("{0}: a report is written as .html")]
    Kind(String),
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A file that waits for its page: whether it can be written is known before any work.
pub struct PageFile(OutputFile);

impl PageFile {
    /// Makes sure that a page can be written to `path`.
    ///
    /// # Errors
    /// [`PageError`].
    pub fn create(path: impl AsRef<Path>, inputs: &Inputs) -> Result<Self, PageError> {
        let path = path.as_ref();
        let is_page =
            |end: &std::ffi::OsStr| end.eq_ignore_ascii_case("html") || end.eq_ignore_ascii_case("htm");
        if !path.extension().is_some_and(is_page) {
            return Err(PageError::Kind(path.display().to_string()));
        }
        Ok(Self(OutputFile::create(path, inputs)?))
    }

    /// Writes the page; from here on it is at its path.
    ///
    /// # Errors
    /// [`PageError::Output`].
    pub fn finish(self, page: &Page) -> Result<(), PageError> {
        self.finish_html(&page.to_html())
    }

    /// Writes a page that was made before, as [`Page::to_html`] gave it.
    ///
    /// # Errors
    /// [`PageError::Output`].
    pub fn finish_html(self, html: &str) -> Result<(), PageError> {
        Ok(self.0.finish_with(html)?)
    }
}

/// Nothing from anywhere; this page's own script and style, known by their hashes.
fn policy() -> String {
    let hash = |text: &str| base64::engine::general_purpose::STANDARD.encode(Sha256::digest(text));
    format!(
        "default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; base-uri 'none'; form-action 'none'",
        hash(SCRIPT),
        hash(STYLE)
    )
}

/// Name and version of the program, as a page gives it.
pub fn generator() -> String {
    format!("pitchleak {}", env!("CARGO_PKG_VERSION"))
}

/// Empty until the script fills it.
fn legend() -> Markup {
    html! {
        aside .legend #legend aria-label="Legend: values under the cursor, lines to show or hide" hidden {
            output #clock {}
            span .tools {
                button type="button" aria-label="Zoom in" { "+" } " "
                button type="button" aria-label="Zoom out" { "−" } " "
                button type="button" { "whole" }
            }
        }
    }
}

fn footer() -> Markup {
    html! {
        footer {
            p {
                "Made by " (generator()) ". This page is complete: it loads nothing and sends nothing. In a chart: drag to zoom in, \
                double-click for the whole; click a name in the legend to hide its line."
            }
            details {
                summary { "Licence of uPlot 1.6.32, which draws the charts" }
                pre { (UPLOT_LICENCE) }
            }
        }
    }
}
