//! The dashboard in a real browser: the value on the page is the one of `/accel`. Needs Chromium (`chromium`, or `OARE_CHROMIUM`); said
//! loudly where there is none.

use std::process::Command;

use crate::service_support::*;
use crate::shared_data;

/// What the browser has in a page some seconds after it was opened.
fn dumped_page(url: &str) -> Option<String> {
    let browser = std::env::var("OARE_CHROMIUM").unwrap_or_else(|_| "chromium".into());
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(&browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--virtual-time-budget=8000"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(["--dump-dom", url])
        .output();
    match output {
        Ok(output) => Some(String::from_utf8_lossy(&output.stdout).into_owned()),
        Err(error) => {
            eprintln!("SKIPPED: the dashboard is not looked at, {browser}: {error}");
            None
        }
    }
}

/// The attribute of an element of an id.
fn attribute<'a>(page: &'a str, id: &str, name: &str) -> &'a str {
    let element = &page[page.find(&format!("id=\"{id}\"")).unwrap_or_else(|| panic!("no {id} in the page"))..];
    let element = &element[..element.find('>').unwrap()];
    let value = &element
        [element.find(&format!("{name}=\"")).unwrap_or_else(|| panic!("no {name}: {element}")) + name.len() + 2..];
    &value[..value.find('"').unwrap()]
}

#[tokio::test(flavor = "multi_thread")]
async fn the_value_on_the_page_is_the_one_of_accel() {
    let Some(folder) = shared_data("dumps") else { return };
    let running = start().await;
    running.send(&std::fs::read(folder.join("clean-6h.dump")).unwrap()).await;
    running.wait_for_playbacks(1).await;
    let url = running.url("/");
    let Some(page) = tokio::task::spawn_blocking(move || dumped_page(&url)).await.unwrap() else { return };
    let accel = running.get("/accel").await;
    for axis in ["ax", "ay", "az"] {
        let shown: f64 = attribute(&page, axis, "data-ng").parse().unwrap();
        assert_eq!(Some(shown), accel[format!("{axis}_ng")].as_f64(), "{axis}");
    }
    assert_eq!(attribute(&page, "now", "data-revision"), accel["revision"].as_str().unwrap());
    assert!(page.contains("class=\"chip good\">live<") && page.contains("class=\"chip good\">running<"), "not live");
}
