//! `mutants ROOT LIST.json`: rewrites the sources under ROOT so that `crate::mutant(N)` chooses mutant N of the list
//! when the program runs. The list is that of `cargo mutants --list --json`, with an `id` for each. Prints the ids
//! that have no place.

use proc_macro2::Span;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// One mutant of the list.
struct Mutant {
    id: u64,
    genre: String,
    replacement: String,
    /// Line and column, from 1.
    start: (usize, usize),
}

impl Mutant {
    fn of(entry: &Value) -> Option<Self> {
        let (text, start) = (|key: &str| Some(entry[key].as_str()?.to_owned()), &entry["span"]["start"]);
        Some(Self {
            id: entry["id"].as_u64()?,
            genre: text("genre")?,
            replacement: text("replacement")?,
            start: (start["line"].as_u64()? as usize, start["column"].as_u64()? as usize),
        })
    }
}

/// What a mutant makes of a range of the text: `before` the operator, the operator's place, and what comes instead.
struct Edit<'a> {
    range: Range<usize>,
    /// The part to be replaced; empty at the start of a function's body.
    part: Range<usize>,
    mutant: &'a Mutant,
}

/// Finds where in the text the mutants belong.
struct Places<'a> {
    text: &'a str,
    line_starts: Vec<usize>,
    mutants: &'a [Mutant],
    edits: Vec<Edit<'a>>,
}

impl Places<'_> {
    fn range(&self, span: Span) -> Range<usize> {
        let offset = |line: usize, column: usize| {
            let start = self.line_starts[line - 1];
            start + self.text[start..].chars().take(column).map(char::len_utf8).sum::<usize>()
        };
        offset(span.start().line, span.start().column)..offset(span.end().line, span.end().column)
    }

    fn place(&mut self, genre: &str, at: Span, part: Range<usize>, range: Range<usize>) {
        let start = (at.start().line, at.start().column + 1);
        let fitting = self.mutants.iter().filter(|mutant| mutant.genre == genre && mutant.start == start);
        self.edits.extend(fitting.map(|mutant| Edit { range: range.clone(), part: part.clone(), mutant }));
    }
}

impl<'a> Visit<'a> for Places<'_> {
    fn visit_expr_binary(&mut self, node: &'a syn::ExprBinary) {
        self.place("BinaryOperator", node.op.span(), self.range(node.op.span()), self.range(node.span()));
        visit::visit_expr_binary(self, node);
    }

    fn visit_expr_unary(&mut self, node: &'a syn::ExprUnary) {
        self.place("UnaryOperator", node.op.span(), self.range(node.op.span()), self.range(node.span()));
        visit::visit_expr_unary(self, node);
    }

    fn visit_arm(&mut self, node: &'a syn::Arm) {
        if let Some((_, guard)) = &node.guard {
            self.place("MatchArmGuard", guard.span(), self.range(guard.span()), self.range(guard.span()));
        }
        visit::visit_arm(self, node);
    }

    fn visit_block(&mut self, node: &'a syn::Block) {
        if let Some(first) = node.stmts.first() {
            let open = self.range(node.brace_token.span.open()).end;
            self.place("FnValue", first.span(), open..open, open..open);
        }
        visit::visit_block(self, node);
    }
}

/// The text of `range` with the edits inside it.
fn render(text: &str, range: Range<usize>, edits: &[&Edit<'_>]) -> String {
    let inside: Vec<&Edit<'_>> = edits
        .iter()
        .copied()
        .filter(|edit| edit.range.start >= range.start && edit.range.end <= range.end)
        .collect();
    let Some(outermost) = inside.iter().min_by_key(|edit| (edit.range.start, usize::MAX - edit.range.end))
    else {
        return text[range].to_owned();
    };
    let place = outermost.range.clone();
    let (here, rest): (Vec<_>, Vec<_>) = inside.iter().copied().partition(|edit| edit.range == place);
    let choices: String = here.iter().map(|edit| choice(text, edit, &rest)).collect();
    let chosen = match place.is_empty() {
        true => choices,
        false => format!("({choices}{{ ({}) }})", render(text, place.clone(), &rest)),
    };
    format!("{}{chosen}{}", &text[range.start..place.start], render(text, place.end..range.end, &rest))
}

/// "If this mutant is chosen, its code".
fn choice(text: &str, edit: &Edit<'_>, inner: &[&Edit<'_>]) -> String {
    let Edit { range, part, mutant: Mutant { id, replacement, .. } } = edit;
    if range.is_empty() {
        return format!(" if crate::mutant({id}) {{ return {replacement}; }} ");
    }
    let (before, after) = (range.start..part.start, part.end..range.end);
    let (before, after) = (render(text, before, inner), render(text, after, inner));
    format!("if crate::mutant({id}) {{ ({before}{replacement}{after}) }} else ")
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [root, list] = arguments.as_slice() else { return Err("usage: mutants ROOT LIST.json".into()) };
    let list: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(list)?)?;
    let mut files = BTreeMap::<&str, Vec<Mutant>>::new();
    for entry in &list {
        files.entry(entry["file"].as_str().ok_or("no file")?).or_default().extend(Mutant::of(entry));
    }
    for (file, mutants) in files {
        let path = std::path::Path::new(root).join(file);
        let text = std::fs::read_to_string(&path)?;
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let mut places = Places { text: &text, line_starts, mutants: &mutants, edits: Vec::new() };
        places.visit_file(&syn::parse_file(&text)?);
        let placed: BTreeSet<u64> = places.edits.iter().map(|edit| edit.mutant.id).collect();
        mutants
            .iter()
            .filter(|mutant| !placed.contains(&mutant.id))
            .for_each(|mutant| println!("{}", mutant.id));
        std::fs::write(&path, render(&text, 0..text.len(), &places.edits.iter().collect::<Vec<_>>()))?;
    }
    Ok(())
}
