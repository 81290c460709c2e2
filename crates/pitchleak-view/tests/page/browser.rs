//! Every kind of page in a browser: it opens without a complaint, draws its charts, follows the cursor and zooms. Needs
//! `chromium`; run with `-- --ignored`.

use super::made;
use std::process::Command;

/// Moves the pointer over the first chart, then drags over half of it, and leaves what came of it in the document.
const VISITOR: &str = r#"
  const over = document.querySelector(".u-over");
  const { left, top, width, height } = over.getBoundingClientRect();
  const say = (name, value) => { document.documentElement.dataset[name] = value; };
  const pointer = (type, share, target = over) => target.dispatchEvent(new MouseEvent(type, {
    bubbles: true, button: 0, movementX: 1, clientX: left + share * width, clientY: top + height / 2 }));
  pointer("mouseenter", 0.5); pointer("mousemove", 0.5);
  setTimeout(() => {
    say("clock", document.getElementById("clock").textContent);
    say("cursors", [...document.querySelectorAll(".u-cursor-x")].filter((line) => /translate\([1-9]/.test(line.style.transform)).length);
    pointer("mousedown", 0.25); pointer("mousemove", 0.75); pointer("mouseup", 0.75, document);
    setTimeout(() => {
      say("zoomed", document.documentElement.dataset.from + " to " + document.documentElement.dataset.to);
      say("requests", performance.getEntriesByType("resource").length);
    }, 300);
  }, 300);
"#;

/// Asks axe-core for what shuts out readers who see or move little, and leaves it in the document.
const AUDITOR: &str = r#"
  axe.run(document, { resultTypes: ["violations"] }).then(({ violations }) => {
    const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
    const nodes = ({ nodes }) => nodes.map(({ target }) => target.join(" ")).join(", ");
    document.documentElement.dataset.barriers = grave.map((one) => `${one.id}: ${nodes(one)}`).join("; ") || "none";
  });
"#;

/// What chromium makes of a page: its document after the scripts ran, and its log.
fn visit(page: &str, options: &[&str]) -> (String, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("page.html");
    std::fs::write(&path, page).expect("writes");
    let profile = format!("--user-data-dir={}", folder.path().join("profile").display());
    let usual = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        "--virtual-time-budget=5000",
        "--dump-dom",
    ];
    let mut command = Command::new("chromium");
    command.args(usual).args(options).arg(profile).arg(format!("file://{}", path.display()));
    let output = command.output().expect("chromium runs");
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// The value that a script left in the document's element.
fn left<'a>(document: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = document.split_once(&format!(" data-{name}=\""))?;
    rest.split('"').next()
}

fn assert_opens(page: &str) {
    let charts = page.matches("data-chart=").count();
    assert!(charts > 0, "no chart");
    let dark = "--blink-settings=preferredColorScheme=0";
    for options in [&["--window-size=1280,900"][..], &["--window-size=390,844"], &[dark]] {
        let (document, log) = visit(page, options);
        let complaints: Vec<_> = log.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(complaints.is_empty(), "{options:?}: {complaints:?}");
        assert_eq!(left(&document, "drawn"), Some(charts.to_string().as_str()), "{options:?}");
        assert_eq!(document.matches("<canvas").count(), charts, "{options:?}");
    }
    assert_open_to_all(page);
    assert_prints(page, charts);
}

/// On paper each chart is an SVG with its lines.
fn assert_prints(page: &str, charts: usize) {
    let (document, log) = visit(&with_script(page, "dispatchEvent(new Event('beforeprint'))"), &[]);
    assert!(!log.contains("CONSOLE"), "{log}");
    assert_eq!(document.matches("<svg class=\"print\"").count(), charts);
    assert!(document.matches(" d=\"M").count() >= charts, "lines");
}

/// The page with a script of ours at its end, and a policy that lets it run.
fn with_script(page: &str, script: &str) -> String {
    let (head, rest) = page.split_once("script-src 'sha256-").expect("a policy");
    let (_, rest) = rest.split_once('\'').expect("a hash");
    let (body, end) = rest.rsplit_once("</body>").expect("a body");
    format!("{head}script-src 'unsafe-inline'{body}<script>{script}</script></body>{end}")
}

/// axe-core as a Python package brings it (`.ci/run`): by its path in `AXE`, else in CI's environment.
fn axe() -> Option<String> {
    let installed = "../../target/venv/lib/python3*/site-packages/axe_playwright_python/axe.min.js";
    let given = std::env::var_os("AXE").map(std::path::PathBuf::from);
    let found = given.or_else(|| glob::glob(installed).ok()?.find_map(Result::ok))?;
    Some(std::fs::read_to_string(found).expect("reads axe"))
}

/// No barrier that axe-core calls serious or critical, on a phone in both themes.
fn assert_open_to_all(page: &str) {
    let Some(axe) = axe() else {
        eprintln!("skipped: no axe-core; AXE names its axe.min.js");
        return;
    };
    let page = with_script(page, &format!("{axe}</script><script>{AUDITOR}"));
    for theme in [&[][..], &["--blink-settings=preferredColorScheme=0"]] {
        let (document, _) = visit(&page, &[&["--window-size=390,844"], theme].concat());
        assert_eq!(left(&document, "barriers"), Some("none"), "{theme:?}");
    }
}

/// Opens whatever is folded, and leaves how far the page is wider than its window.
const SURVEYOR: &str = r#"
  document.querySelectorAll("details").forEach((one) => { one.open = true; });
  document.documentElement.dataset.beyond = document.documentElement.scrollWidth - document.documentElement.clientWidth;
"#;

/// On a laptop and on a phone nobody has to scroll sideways but within a table.
fn assert_fits(page: &str) {
    let page = with_script(page, SURVEYOR);
    for window in ["--window-size=1366,768", "--window-size=390,844"] {
        let (document, _) = visit(&page, &[window]);
        assert_eq!(left(&document, "beyond"), Some("0"), "{window}");
    }
}

/// Leaves whether the legend is there on the first screen, and what is in it beside the second chart.
const READER: &str = r#"
  const legend = document.getElementById("legend");
  setTimeout(() => {
    document.documentElement.dataset.above = legend.hidden;
    document.querySelectorAll(".chart")[1].scrollIntoView({ block: "center" });
    dispatchEvent(new Event("scroll")); // Without a screen there are no frames, and so no such event.
    setTimeout(() => {
      const seen = [...legend.querySelectorAll(".group:not([hidden]) button:not([hidden])")];
      document.documentElement.dataset.seen = seen.map((button) => button.children[1].textContent).join(", ");
    }, 500);
  }, 500);
"#;

/// A bar that stands over every screen has only what the screen has.
fn assert_legend_is_of_charts_in_sight(page: &str) {
    let (document, log) = visit(&with_script(page, &format!("{{{READER}}}")), &["--window-size=1280,420"]);
    assert!(!log.contains("CONSOLE"), "{log}");
    assert_eq!(left(&document, "above"), Some("true"));
    assert_eq!(left(&document, "seen"), Some("x"));
}

fn assert_cursor_and_zoom_work(page: &str) {
    let page = with_script(page, &format!("{{{VISITOR}}}"));
    let (document, log) = visit(&page, &["--window-size=1280,4000"]);
    assert!(!log.contains("CONSOLE"), "{log}");
    assert_eq!(left(&document, "requests"), Some("0"));
    let clock = left(&document, "clock").and_then(|text| text.strip_suffix(" s")).expect("a time");
    assert!((clock.parse::<f64>().expect("a number") - 20.0).abs() < 0.2, "{clock}");
    let zoomed = left(&document, "zoomed").expect("zoomed");
    let ends: Vec<f64> = zoomed.split(" to ").map(|end| end.parse().expect("a time")).collect();
    assert!((ends[0] - 10.0).abs() < 0.5 && (ends[1] - 30.0).abs() < 0.5, "{zoomed}");
    assert!(left(&document, "cursors").expect("cursors").parse::<usize>().expect("a number") > 3);
}

#[test]
#[ignore = "needs chromium"]
fn a_replay() {
    let page = made::replayed(made::TRACE, &made::rig());
    assert_opens(&page);
    assert_cursor_and_zoom_work(&page);
    assert_legend_is_of_charts_in_sight(&page);
}

#[test]
#[ignore = "needs chromium"]
fn a_check() {
    assert_opens(&made::checked());
}

#[test]
#[ignore = "needs chromium"]
fn a_diagnosis() {
    assert_opens(&made::diagnosed());
}

#[test]
#[ignore = "needs chromium"]
fn a_fleet() {
    let page = made::fleet();
    assert_opens(&page);
    assert_fits(&page);
}

#[test]
#[ignore = "needs chromium"]
fn a_reproduction() {
    let page = made::reproduced();
    assert!(page.len() <= 1_000_000, "{} bytes", page.len());
    assert_opens(&page);
}
