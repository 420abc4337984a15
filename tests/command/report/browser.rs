//! A page in a real browser: every picture decodes, and nothing is wider than a phone.

use super::{FULL, report, views};
use crate::support::folder;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Names that Chromium and its relatives have.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// Shows the page in a frame of a phone's and of a desktop's width, and writes what it finds into its own body.
///
/// All of it runs inside the frames' load events, which the browser waits for before it dumps the document: pictures
/// stand in the page itself, so they are there by then, and drawing one decodes it at once. Nothing is awaited,
/// since how long a browser's threads decode has nothing to do with its virtual time.
const CHECK: &str = r#"<!DOCTYPE html><body>
<iframe id="phone" style="width: 390px; height: 800px"></iframe>
<iframe id="desktop" style="width: 1280px; height: 800px"></iframe>
<script>
const found = {};
const pen = document.createElement("canvas").getContext("2d");
const decodes = image => {
  try {
    pen.drawImage(image, 0, 0);
    pen.getImageData(0, 0, 1, 1);
    return image.complete && image.naturalWidth > 0;
  } catch (error) {
    return false;
  }
};
for (const frame of document.querySelectorAll("iframe")) {
  frame.onload = () => {
    const page = frame.contentDocument, root = page.documentElement, images = [...page.images];
    page.querySelectorAll("details").forEach(details => details.open = true);
    const charts = [...page.querySelectorAll("svg")].filter(svg => svg.getBoundingClientRect().width > 200);
    found[frame.id] = {
      images: images.length,
      decoded: images.filter(decodes).length,
      charts: charts.length,
      overflow: Math.max(0, root.scrollWidth - root.clientWidth),
    };
    if (Object.keys(found).length == 2) document.body.textContent = "FOU" + "ND" + JSON.stringify(found) + "END";
  };
  frame.src = "page.html";
}
</script>"#;

/// The browser to use: `$CHROME`, else the first on the path.
fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let named = std::env::var_os("CHROME").map(PathBuf::from);
    let on_path = || {
        let folders: Vec<_> = std::env::split_paths(&path).collect();
        NAMES
            .iter()
            .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
            .find(|file| file.is_file())
    };
    named.or_else(on_path)
}

/// What a browser without network finds in a page; `None` where there is none.
pub(crate) fn look_at(html: &str) -> Option<serde_json::Value> {
    let Some(browser) = browser() else {
        assert!(
            std::env::var_os("NERF_REQUIRE_BROWSER").is_none(),
            "NERF_REQUIRE_BROWSER is set and there is no browser: install chromium, or set CHROME to its path"
        );
        eprintln!("LEFT OUT: no chromium on the path and none in $CHROME; scripts/report_test.sh needs one");
        return None;
    };
    let folder = folder();
    std::fs::write(folder.path().join("page.html"), html).expect("writable");
    std::fs::write(folder.path().join("check.html"), CHECK).expect("writable");
    let dom = dump(&browser, folder.path());
    let found = dom.split_once("FOUND").and_then(|(_, rest)| rest.split_once("END"));
    let (found, _) = found.unwrap_or_else(|| panic!("{} told nothing: {dom}", browser.display()));
    Some(serde_json::from_str(found).expect("JSON"))
}

fn dump(browser: &Path, folder: &Path) -> String {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", "--allow-file-access-from-files"])
        .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1400,900"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", folder.join("check.html").display()))
        .output();
    let output = output.unwrap_or_else(|error| panic!("starting {}: {error}", browser.display()));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {}\n{told}", browser.display(), output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_browser_shows_every_picture_and_nothing_overflows() {
    let mut long = report(FULL, Ok(views(20, 200)));
    long.facts.dataset = Some("x".repeat(300));
    long.log.starts[1].driver = Some("driver/".repeat(60));
    long.facts.settings = Some("wide ".repeat(100));
    let html = long.html().expect("a page");
    let pictures = html.matches("<img ").count();
    let Some(found) = look_at(&html) else { return };
    for width in ["phone", "desktop"] {
        assert_eq!(found[width]["images"], pictures, "{found}");
        assert_eq!(found[width]["decoded"], pictures, "{found}");
        assert_eq!(found[width]["charts"], 8, "{found}");
        assert_eq!(found[width]["overflow"], 0, "{found}");
    }
}

#[test]
fn a_picture_that_does_not_decode_would_be_found() {
    let html =
        "<!DOCTYPE html><img src=\"data:image/png;base64,AAAA\"><div style=\"width: 2000px\">wide</div>";
    let Some(found) = look_at(html) else { return };
    assert_eq!((&found["phone"]["images"], &found["phone"]["decoded"]), (&1.into(), &0.into()), "{found}");
    assert!(found["phone"]["overflow"].as_u64() > Some(1000), "{found}");
}
