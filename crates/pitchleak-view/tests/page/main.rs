//! What every page keeps, whatever the trace: complete in itself, well-formed, harmless, of bounded size.

mod browser;
mod made;

use made::{TRACE, diagnosed, fleet, replayed, rig};
use pitchleak::Rig;
use pitchleak::replay::Replay;
use pitchleak::report::TraceSummary;
use pitchleak::trace::{Record, TraceReader};
use pitchleak_view::page::{History, Page, PageFile};

/// The page without what is in `<script>` and `<style>`.
fn markup(page: &str) -> String {
    let mut out = String::new();
    let mut rest = page;
    while let Some(start) = ["<script", "<style"].iter().filter_map(|tag| rest.find(tag)).min() {
        let open = start + rest[start..].find('>').expect("a tag ends") + 1;
        let close = open
            + ["</script>", "</style>"]
                .iter()
                .filter_map(|tag| rest[open..].find(tag))
                .min()
                .expect("closed");
        out.push_str(&rest[..open]);
        rest = &rest[close..];
    }
    out + rest
}

/// Panics where a tag is not closed in its turn.
fn assert_well_formed(markup: &str) {
    let mut open: Vec<&str> = Vec::new();
    for piece in markup.split('<').skip(1) {
        let tag = piece.split('>').next().expect("a tag ends");
        let name = tag.trim_start_matches('/').split([' ', '\n']).next().expect("a name");
        match name {
            "!DOCTYPE" | "meta" => {}
            _ if tag.starts_with('/') => assert_eq!(open.pop(), Some(name), "closed out of turn"),
            _ => open.push(name),
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

fn assert_complete_in_itself(page: &str) {
    let markup = markup(page);
    assert_well_formed(&markup);
    assert!(page.contains("default-src 'none'; script-src 'sha256-"), "no policy");
    let tags: String = markup.split('<').filter_map(|piece| piece.split('>').next()).collect();
    for lure in ["src=", "href=\"http", "href=\"//", "url(", "@import", "<link", "<iframe", "<img", " style="]
    {
        assert!(!tags.contains(lure), "{lure}");
    }
    let (_, style) = page.split_once("<style>").expect("has a style");
    let (style, _) = style.split_once("</style>").expect("ends");
    assert!(!style.contains("url(") && !style.contains("@import"));
    assert!(page.contains("Permission is hereby granted, free of charge"), "the licence of uPlot is missing");
}

/// What the head line says is what the drawing shows.
#[test]
fn a_leak_is_drawn_where_it_is() {
    let page = replayed(TRACE, &rig());
    for drawn in [
        "leak leaks\" data-leak=\"external_a",
        "leak below\" data-leak=\"internal",
        "sensor \" data-sensor=\"qa",
    ] {
        assert!(page.contains(&format!("class=\"{drawn}\"")), "{drawn}");
    }
    assert!(page.contains("aria-label=\"The cylinder: internal leak 0.00"));
}

#[test]
fn meters_that_are_exchanged_are_marked_and_no_leak_is_drawn() {
    let exchanged = "[columns]\nqa = { name = \"qb_lpm\", unit = \"L/min\" }\nqb = { name = \"qa_lpm\", unit = \"L/min\" }\n";
    let rig = Rig::parse(&format!("{}\n{exchanged}", rig().to_toml()), "rig").expect("a rig");
    let page = replayed(TRACE, &rig);
    for drawn in [
        "leak unknown\" data-leak=\"external_a",
        "sensor suspected\" data-sensor=\"qa",
        "sensor \" data-sensor=\"pa",
    ] {
        assert!(page.contains(&format!("class=\"{drawn}\"")), "{drawn}");
    }
}

#[test]
fn a_page_of_a_replay_has_all_its_parts() {
    let page = replayed(TRACE, &rig());
    assert_complete_in_itself(&page);
    let parts = [
        "LEAK</h1>",
        "External A leak of 0.5",
        "What to do",
        "What this trace does not tell",
        "id=\"leaks\"",
        "id=\"signals\"",
        "id=\"residuals\"",
        "id=\"channels\"",
        "id=\"rig\"",
        "id=\"made\"",
        "alarm level",
        "<table>",
        concat!("pitchleak ", env!("CARGO_PKG_VERSION")),
    ];
    for part in parts {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn an_hour_at_100_hz_fits_in_a_megabyte() {
    let rig = rig();
    let mut reader = TraceReader::open(TRACE, &rig).expect("a trace");
    let (mut records, mut record) = (Vec::new(), Record::default());
    while reader.next_record(&mut record).expect("reads") {
        records.push(record);
    }
    let mut replay = Replay::new(&rig).expect("a replay");
    let mut history = History::default();
    for round in 0..90_u32 {
        for (number, record) in records.iter().enumerate() {
            let begins = number == 0;
            let record = Record {
                t_s: record.t_s + 40.0 * f64::from(round),
                dt_s: 0.01,
                after_gap: begins && round > 0,
                ..*record
            };
            let renewed = replay.push(&record);
            history.add(&replay, &record, renewed);
        }
    }
    let report = replay.report(TraceSummary::new("an hour", reader.quality()));
    let page = Page::of_replay(&report, &rig, &history).to_html();
    assert_complete_in_itself(&page);
    assert!(page.len() <= 1_000_000, "{} bytes", page.len());
}

#[test]
fn a_page_of_a_diagnosis_leads_from_the_residual_to_the_effect() {
    let page = diagnosed();
    assert_complete_in_itself(&page);
    for part in [
        "EXPLAINED</h1>",
        "Coulomb friction",
        "Slip speed: ",
        " mm/s.",
        "What it would take to be sure",
        "not fitted",
        "Force against",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<img"));
}

#[test]
fn a_page_of_a_fleet_says_who_asks_for_somebody_and_what_grows() {
    let page = fleet();
    assert_complete_in_itself(&page);
    let parts = [
        "1 LEAK</h1>",
        "1 could not be judged",
        "One leak grows",
        "since 2025-06-15 or before; oil leaves",
        "<summary>6 traces: 6 leak</summary>",
        "<svg class=\"course\"",
        "0.30",
        "internal leak",
        "days since",
        "no trace.csv",
    ];
    for part in parts {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<img"));
    let (_, first) = page.split_once("What to do first").expect("a card");
    let (first, _) = first.split_once("</ol>").expect("a list");
    assert_eq!(first.matches("<li>").count(), 1, "each cylinder once");
}

#[test]
fn names_of_files_and_columns_do_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("<script>alert(1)<!--\" onload=alert(2) '.csv");
    let header =
        "t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm,\"<img src=x onerror=alert(3)>\",\"</script><script>alert(4)\"";
    let rows = (0..500).map(|k| {
        let t_s = 0.01 * f64::from(k);
        format!("{t_s},{},{},30,0.3,-0.2,1,2\n", 50.0 + 10.0 * t_s.sin(), 40.0 + t_s.cos())
    });
    std::fs::write(&path, format!("{header}\n{}", rows.collect::<String>())).expect("writes");
    let page = replayed(&path, &Rig::paper());
    assert_complete_in_itself(&page);
    assert!(page.contains("&lt;script&gt;alert(1)"), "the file's name is missing");
    assert!(page.contains("&lt;img src=x onerror=alert(3)&gt;"), "the column's name is missing");
    assert!(!page.contains("<script>alert") && !page.contains("\" onload="));
}

#[test]
fn a_page_is_html_and_never_takes_the_place_of_an_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.html");
    std::fs::write(&path, "t_s").expect("writes");
    let inputs = pitchleak::output::Inputs::of([&path]);
    assert!(PageFile::create(&path, &inputs).is_err());
    assert!(PageFile::create(folder.path().join("report.csv"), &inputs).is_err());
    assert_eq!(std::fs::read_to_string(&path).expect("reads"), "t_s");
    drop(PageFile::create(folder.path().join("other.html"), &inputs).expect("can be written"));
    assert!(!folder.path().join("other.html").exists(), "a page that was never finished");
}
