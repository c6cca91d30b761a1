//! The interface from outside: what is asked, what is answered, who may.

use oare_ground::hub::status::Phase;
use serde_json::Value;

use crate::service_support::*;
use crate::shared_data;

#[tokio::test(flavor = "multi_thread")]
async fn before_anything_came_there_is_no_value_and_that_is_a_problem_document() {
    let running = start().await;
    let (status, problem) = running.problem("/accel").await;
    assert_eq!((status, problem["status"].as_u64()), (404, Some(404)));
    assert!(problem["detail"].as_str().unwrap().contains("no calibrated window"));
    let history = running.get("/accel/history").await;
    assert_eq!(history["windows"], 0);
    let status = running.get("/status").await;
    assert_eq!(status["ingest"]["frames_durable"], 0);
    assert_eq!(status["accel"]["windows"], 0);
    assert!(status["uptime_s"].as_f64().unwrap() > 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_named_route_answers_and_is_described() {
    let running = start().await;
    running.send(&dump(20_000, 300, 0)).await;
    running.wait_for_playbacks(1).await;
    let openapi = running.get("/openapi.json").await;
    let named = [
        "/accel",
        "/accel/history",
        "/accel/live",
        "/calibration",
        "/calibration/history",
        "/gaps",
        "/playbacks",
        "/events",
        "/anomalies",
        "/diagnosis",
        "/status",
        "/healthz",
        "/readyz",
        "/metrics",
    ];
    for path in named {
        assert!(openapi["paths"][path]["get"].is_object(), "{path} is not described");
    }
    let described = |path: &str, status: &str| {
        openapi["paths"][path]["get"]["responses"][status]["content"]["application/problem+json"].is_object()
    };
    for path in ["/accel", "/accel/history", "/accel/live", "/calibration", "/gaps"] {
        assert!(described(path, "400"), "{path}");
        assert!(described(path, "401") && described(path, "414"), "{path}");
    }
    assert!(!described("/healthz", "401") && !described("/readyz", "401"));
    // As the standard has it: every response says what it is, every refusal is a problem, and the two ways to show a token are named.
    for (path, item) in openapi["paths"].as_object().unwrap() {
        for (status, response) in item["get"]["responses"].as_object().unwrap() {
            assert!(response["description"].is_string(), "{path} {status}");
            let schema = &response["content"]["application/problem+json"]["schema"]["$ref"];
            assert_eq!(status.as_str() >= "400", *schema == "#/components/schemas/Problem", "{path} {status}");
        }
    }
    assert!(openapi["components"]["schemas"]["Problem"]["properties"]["detail"].is_object());
    assert_eq!(openapi["components"]["securitySchemes"]["query"]["name"], "access_token");
    let window = &openapi["components"]["schemas"]["Window"].to_string();
    for word in ["range_corrected", "extrapolated", "uncalibrated", "table_moving", "q_x", "known_since_clock_s"] {
        assert!(window.contains(word), "{word} is not described: {window}");
    }
    for path in ["/gaps", "/playbacks", "/events", "/anomalies", "/calibration/history", "/status", "/accel/history"] {
        running.get(path).await;
    }
    for path in ["/healthz", "/readyz", "/"] {
        assert_eq!(reqwest::get(running.url(path)).await.unwrap().status(), 200, "{path}");
    }
    let metrics = reqwest::get(running.url("/metrics")).await.unwrap().text().await.unwrap();
    let durable = metrics.lines().find(|line| line.starts_with("oare_frames_durable_total ")).unwrap();
    let frames: u64 = durable.rsplit(' ').next().unwrap().parse().unwrap();
    assert_eq!(running.get("/status").await["ingest"]["frames_durable"], frames);
    let (status, _) = running.problem("/nowhere").await;
    assert_eq!(status, 404);
    let posted = reqwest::Client::new().post(running.url("/accel")).send().await.unwrap();
    assert_eq!(problem_of(posted).await.0, 405);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_dashboard_needs_nothing_from_outside() {
    let running = start().await;
    let page = reqwest::get(running.url("/")).await.unwrap().text().await.unwrap();
    assert!(!page.contains("http://") && !page.contains("https://"), "the page names another origin");
    for part in page.split('"').filter(|part| part.starts_with("dashboard/")) {
        let answer = reqwest::get(running.url(&format!("/{part}"))).await.unwrap();
        assert_eq!(answer.status(), 200, "{part}");
        assert!(answer.headers()["content-security-policy"].to_str().unwrap().starts_with("default-src 'none'"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_configured_token_is_needed_everywhere_but_for_health() {
    const TOKEN: &str = "a-token-of-some-length";
    let running = start_with(|config| config.http.token = Some(TOKEN.into())).await;
    for path in ["/accel", "/status", "/", "/metrics", "/accel/live"] {
        let answer = reqwest::get(running.url(path)).await.unwrap();
        assert_eq!(answer.status(), 401, "{path}");
        assert!(answer.headers().contains_key("www-authenticate"));
    }
    // A browser asks for the parts of the page without the token that the page was asked with.
    let page = reqwest::get(running.url(&format!("/?access_token={TOKEN}"))).await.unwrap().text().await.unwrap();
    let parts: Vec<&str> = page.split('"').filter(|part| part.starts_with("dashboard/")).collect();
    assert_eq!(parts.len(), 4, "{parts:?}");
    for path in parts.iter().map(|part| format!("/{part}")).chain(["/healthz".into()]) {
        assert_eq!(reqwest::get(running.url(&path)).await.unwrap().status(), 200, "{path}");
    }
    let client = reqwest::Client::new();
    let with_header = |token: &str| client.get(running.url("/status")).bearer_auth(token).send();
    assert_eq!(with_header(TOKEN).await.unwrap().status(), 200);
    assert_eq!(with_header("another-token-of-length").await.unwrap().status(), 401);
    assert_eq!(reqwest::get(running.url(&format!("/status?access_token={TOKEN}"))).await.unwrap().status(), 200);
    let mut live = running.live(&format!("access_token={TOKEN}")).await;
    assert_eq!(live.next().await.unwrap()["type"], "hello");
    let refused = tokio_tungstenite::connect_async(format!("ws://{}/accel/live", running.service.http_address)).await;
    assert!(refused.is_err(), "a WebSocket without the token");
}

/// A browser lets any page open a socket to this machine, and says whose page it is.
#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_another_site_reads_nothing_where_there_is_no_token() {
    let running = start().await;
    let client = reqwest::Client::new();
    let own = format!("http://{}", running.service.http_address);
    for (origin, status) in [
        ("http://evil.example", 403),
        ("https://127.0.0.1.evil.example:8080", 403),
        ("http://localhost:3000", 200),
        ("http://[::1]:3000", 200),
        ("null", 403),
        (&own, 200),
    ] {
        let answer = client.get(running.url("/status")).header("Origin", origin).send().await.unwrap();
        assert_eq!(answer.status(), status, "{origin}");
    }
    // A name of another site that leads to this machine, asked by that site's own page.
    let port = running.service.http_address.port();
    for (host, status) in [("evil.example", 403), ("localhost", 200), ("127.0.0.1", 200), ("[::1]", 200)] {
        let host = format!("{host}:{port}");
        let request =
            client.get(running.url("/status")).header("Host", &host).header("Origin", format!("http://{host}"));
        assert_eq!(request.send().await.unwrap().status(), status, "{host}");
    }
}

/// What was received before is not there yet after a start, and is not said to be nothing.
#[tokio::test(flavor = "multi_thread")]
async fn while_the_log_is_read_again_products_are_not_told() {
    let running = start().await;
    running.send(&dump(20_000, 300, 0)).await;
    running.wait_for_playbacks(1).await;
    running.service.board.enter(Phase::Replaying);
    for path in
        ["/accel", "/accel/history", "/accel/live?from=seq:1", "/calibration", "/gaps", "/playbacks", "/anomalies"]
    {
        let answer = reqwest::get(running.url(path)).await.unwrap();
        assert_eq!((answer.status().as_u16(), answer.headers()["retry-after"].to_str().unwrap()), (503, "1"), "{path}");
        assert!(problem_of(answer).await.1["detail"].as_str().unwrap().contains("raw log"), "{path}");
    }
    assert_eq!(running.get("/status").await["phase"], "replaying");
    running.service.board.enter(Phase::Running);
    running.get("/gaps").await;
}

/// From the first answer after a start on: either all that the log has, or that it is being read.
#[tokio::test(flavor = "multi_thread")]
async fn after_a_restart_no_part_of_the_log_is_taken_for_all_of_it() {
    let running = start().await;
    running.send(&dump(20_000, 20_000, 0)).await;
    let durable = running.wait_for_playbacks(1).await["ingest"]["frames_durable"].clone();
    let running = running.restart().await;
    loop {
        let status = running.get("/status").await;
        match status["phase"].as_str() {
            Some("replaying") => {}
            phase => {
                assert_eq!((phase, &status["ingest"]["frames_durable"]), (Some("running"), &durable));
                break;
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_in_a_query_may_stand_as_it_is_or_encoded() {
    let running = start_with(|config| config.http.token = Some("aGVsbG8gd29ybGQ+/3c=".into())).await;
    for (token, status) in
        [("aGVsbG8gd29ybGQ+/3c=", 200), ("aGVsbG8gd29ybGQ%2B%2F3c%3D", 200), ("aGVsbG8gd29ybGQ%20%2F3c%3D", 401)]
    {
        let answer = reqwest::get(running.url(&format!("/status?access_token={token}"))).await.unwrap();
        assert_eq!(answer.status(), status, "{token}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn parameters_that_make_no_sense_are_named() {
    let running = start().await;
    let cases = [
        ("/accel/history?from=soon", "soon"),
        ("/accel/history?from=10&to=5", "after"),
        ("/accel/history?max_points=0", "max_points"),
        ("/accel/history?max_points=many", "max_points"),
        ("/accel/history?from=1&from=2", "`from`"),
        ("/accel/live?from=1&from=2", "`from`"),
        ("/calibration?as_of=1&as_of=2", "`as_of`"),
        ("/calibration?as_of=1994-13-01", "as_of"),
        ("/accel/live?topics=weather", "weather"),
        ("/accel/live?from=seq:x", "seq:x"),
        ("/accel/live?from=seq:99999", "99999"),
        // One that there is not, and those that there are.
        ("/calibration?asof=4", "`asof` is no parameter of /calibration, which has `as_of` alone"),
        ("/accel/history?max_point=4", "`from`, `to`, `max_points`"),
        ("/accel/live?from=now&topic=diagnosis", "`topic` is no parameter of /accel/live, which has `from`, `topics`"),
        ("/diagnosis?as_of=400000", "which has none"),
        ("/accel?as_of=400000", "`as_of`"),
        ("/events?from=400000", "`from`"),
        ("/status?x", "`x`"),
        ("/openapi.json?x=1", "`x`"),
        ("/calibration?as_of=1&as_of=2", "`as_of` is given more than once"),
    ];
    for (path, named) in cases {
        let (status, problem) = running.problem(path).await;
        assert_eq!(status, 400, "{path}");
        assert!(problem["detail"].as_str().unwrap().contains(named), "{path}: {problem}");
    }
    assert_eq!(running.get("/status?access_token=whatever").await["phase"], "running");
}

/// What was known is asked again with everything that products were made with.
#[tokio::test(flavor = "multi_thread")]
async fn a_calibration_of_the_past_comes_with_the_ranges_corrected_then() {
    let Some(folder) = shared_data("dumps") else { return };
    let running = start().await;
    running.send(&std::fs::read(folder.join("defects-24h.dump")).unwrap()).await;
    running.wait_for_playbacks(1).await;
    let now = running.get("/calibration").await;
    let corrected = now["range_corrections"].as_array().unwrap();
    assert!(!corrected.is_empty(), "{now:#}");
    assert!(corrected.iter().all(|c| c["reported"] == "C" && c["actual"] == "A"), "{corrected:?}");
    let latest = running.get("/status").await["ingest"]["as_of_clock_s"].as_f64().unwrap();
    assert_eq!(running.get(&format!("/calibration?as_of={latest}")).await, now);
    let from_s = corrected[0]["from_clock_s"].as_f64().unwrap();
    let before = running.get(&format!("/calibration?as_of={}", from_s - 100.0)).await;
    assert_eq!(before["range_corrections"].as_array().map(Vec::len), Some(0), "{before:#}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_sample_comes_out_as_accelerations_with_errors_and_history_in_buckets() {
    let Some(folder) = shared_data("dumps") else { return };
    let running = start().await;
    running.send(&std::fs::read(folder.join("clean-6h.dump")).unwrap()).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["seconds_covered"], 21_600);
    let accel = running.get("/accel").await;
    assert_eq!(accel["frame"], "orbiter_body");
    for axis in ["x", "y", "z"] {
        assert!(accel[format!("a{axis}_ng")].is_f64(), "{accel}");
        assert!(accel[format!("sigma_a{axis}_ng")].as_f64().unwrap() > 0.0, "{accel}");
    }
    let all = running.get("/accel/history?max_points=100000").await;
    let windows = all["windows"].as_u64().unwrap();
    assert_eq!(windows, status["accel"]["windows"].as_u64().unwrap());
    let coarse = running.get("/accel/history?max_points=50").await;
    let buckets = coarse["buckets"].as_array().unwrap();
    assert!(buckets.len() <= 50);
    assert_eq!(buckets.iter().map(|bucket| bucket["count"].as_u64().unwrap()).sum::<u64>(), windows);
    let extreme = |history: &Value, which: &str| {
        let values = history["buckets"].as_array().unwrap().iter().filter_map(|bucket| bucket["az_ng"][which].as_f64());
        values.collect::<Vec<_>>()
    };
    let least = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
    assert_eq!(least(extreme(&all, "min")), least(extreme(&coarse, "min")), "buckets keep the extremes");
    let latest = all["buckets"].as_array().unwrap().iter().rev().find(|bucket| !bucket["ax_ng"].is_null()).unwrap();
    assert_eq!(latest["ax_ng"]["mean"], accel["ax_ng"]);
}
