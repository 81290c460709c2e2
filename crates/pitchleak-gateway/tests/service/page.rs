//! The page in Chromium: it opens without a complaint, shows the worst first, and shuts nobody out. Needs `chromium`; run with
//! `-- --ignored`.

use crate::harness::{Gateway, Mosquitto, Sender, batches, wait_until};
use std::path::PathBuf;
use std::process::Command;

/// One that leaks, and one that is sound.
const NAMES: [&str; 2] = ["T7/B2", "T7/B1"];

/// Asks axe-core for what shuts out readers who see or move little, and leaves it in the document.
const AUDITOR: &str = r#"
  setTimeout(() => axe.run(document, { resultTypes: ["violations"] }).then(({ violations }) => {
    const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
    const nodes = ({ nodes }) => nodes.map(({ target }) => target.join(" ")).join(", ");
    document.documentElement.dataset.barriers = grave.map((one) => `${one.id}: ${nodes(one)}`).join("; ") || "none";
  }), 1000);
"#;

/// What chromium makes of an address: its document after the scripts ran, and its log.
fn visit(address: &str, options: &[&str]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let profile = format!("--user-data-dir={}", folder.path().display());
    let mut command = Command::new("chromium");
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]);
    command.args(["--virtual-time-budget=4000", "--dump-dom", &profile]).args(options).arg(address);
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// axe-core by its path in `AXE`, else as a Python package brings it (`.ci/run`).
fn axe() -> Option<String> {
    let given = std::env::var_os("AXE").map(PathBuf::from);
    let lib = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/venv/lib");
    let installed = std::fs::read_dir(lib).ok().and_then(|mut entries| {
        Some(entries.next()?.ok()?.path().join("site-packages/axe_playwright_python/axe.min.js"))
    });
    std::fs::read_to_string(given.or(installed)?).ok()
}

fn body(answer: &str) -> &str {
    answer.split_once("\r\n\r\n").unwrap().1
}

#[test]
#[ignore = "needs chromium"]
fn the_page_shows_the_worst_first_and_shuts_nobody_out() {
    let Some(broker) = Mosquitto::start("") else { return };
    let mut gateway = Gateway::new(&broker, |text| text);
    gateway.start();
    gateway.wait_for("connected");
    let mut sender = Sender::new(broker.port);
    for (name, trace) in NAMES.into_iter().zip(["traces/both.csv.gz", "traces/healthy.csv.gz"]) {
        for batch in batches(trace, 100) {
            sender.send(&format!("pitch/{name}/samples"), batch.as_bytes());
        }
    }
    sender.flush();
    wait_until("both are known", || gateway.metric("pitchleak_estimates_total") >= 78.0);

    let address = gateway.address();
    for options in [&["--window-size=1280,900"][..], &["--window-size=390,844"]] {
        let (document, log) = visit(&address, options);
        assert!(!log.contains("CONSOLE"), "{log}");
        let (leaks, sound) = (document.find("LEAK</span>T7/B2"), document.find("SOUND</span>T7/B1"));
        assert!(leaks.is_some() && leaks < sound, "{document}");
        assert!(document.contains("1 leak, 1 sound"), "{document}");
        assert!(document.contains("class=\"leak leaks\" data-leak=\"internal\""), "{document}");
        assert!(document.contains("L/min, above its alarm level; external A leak 0."), "{document}");
    }

    let Some(axe) = axe() else {
        eprintln!("skipped: no axe-core; AXE names its axe.min.js");
        return;
    };
    // As a file, which no policy keeps from running more than its own script.
    let [page, cylinders, pasts] = ["/", "/cylinders", "/pasts"].map(|path| gateway.get(path));
    let told = format!(
        "<script>fetch = async (path) => ({{ ok: true, json: async () => path === 'pasts' ? {} : {} }});</script>",
        body(&pasts),
        body(&cylinders)
    );
    let audited = body(&page).replacen("<script>", &format!("{told}<script>"), 1).replacen(
        "</body>",
        &format!("<script>{axe}</script><script>{AUDITOR}</script></body>"),
        1,
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.html");
    std::fs::write(&file, audited).unwrap();
    for theme in [&[][..], &["--blink-settings=preferredColorScheme=0"]] {
        let options = [&["--window-size=390,844"], theme].concat();
        let (document, _) = visit(&format!("file://{}", file.display()), &options);
        assert!(document.contains("data-barriers=\"none\""), "{theme:?}: {document}");
    }
}
