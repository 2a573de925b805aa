//! The files of the dashboard.

use crate::support::{Hall, request};

fn header<'a>(head: &'a str, name: &str) -> &'a str {
    let prefix = format!("{name}: ");
    head.lines().find_map(|line| line.strip_prefix(&prefix)).unwrap_or_else(|| panic!("no {name}: {head}"))
}

/// The page, or what stands in its place: which of both depends on whether it was built before the gateway.
#[tokio::test]
async fn the_page_needs_no_token_and_may_load_its_own_files_alone() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    for path in
        ["/", "/robots/press", "/robots/press/teach", "/robots/press/teach/pick", "/alarms", "/gallery"]
    {
        let page = request(address, "", "GET", path, None).await;
        let text = page.body.as_str().unwrap();
        assert_eq!(header(&page.head, "content-type"), "text/html; charset=utf-8");
        assert_eq!(header(&page.head, "cache-control"), "no-store");
        assert_eq!(header(&page.head, "x-content-type-options"), "nosniff");
        let policy = header(&page.head, "content-security-policy");
        assert!(policy.starts_with("default-src 'self'; ") && policy.contains("frame-ancestors 'none'"));
        assert!(!policy.contains("unsafe"), "{policy}");
        if page.status == 404 {
            assert!(text.contains("<code>tools/web build</code>"), "{text}");
            continue;
        }
        assert_eq!(page.status, 200);
        let assets: Vec<_> = text.split('"').filter(|word| word.starts_with("/assets/")).collect();
        assert!(assets.iter().any(|path| path.ends_with(".js")), "{text}");
        for path in assets {
            let file = request(address, "", "GET", path, None).await;
            assert_eq!(file.status, 200, "{path}");
            assert!(header(&file.head, "cache-control").contains("immutable"), "{}", file.head);
            let kind = header(&file.head, "content-type");
            assert!(kind.starts_with("text/") || kind.starts_with("image/"), "{path}: {kind}");
        }
    }
    for path in [
        "/alarm",
        "/%FF",
        "/robots/press/teach/pick/more",
        "/assets/no-such-file.js",
        "/assets/..%2findex.html",
        "/assets/%FF",
    ] {
        let missing = request(address, "", "GET", path, None).await;
        assert!((400..500).contains(&missing.status), "{path}: {}", missing.status);
    }
    let foreign = request(address, "Sec-Fetch-Site: cross-site\r\n", "GET", "/", None).await;
    assert_eq!(foreign.status, 403, "no other page may load it");
}

/// A person who typed an address gets the dashboard, which says that there is no such page. A program gets
/// a problem.
#[tokio::test]
async fn an_address_of_no_page_is_told_as_the_caller_asked() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    let browser = "Accept: text/html,application/xhtml+xml,*/*;q=0.8\r\n";
    for path in ["/alarm", "/robots/press/teach/pick/more", "/v2/robots"] {
        let page = request(address, browser, "GET", path, None).await;
        assert_eq!(page.status, 404, "{path}");
        assert_eq!(header(&page.head, "content-type"), "text/html; charset=utf-8", "{path}");
        assert!(page.head.contains("content-security-policy"), "{path}");
        let program = request(address, "Accept: */*\r\n", "GET", path, None).await;
        assert_eq!(header(&program.head, "content-type"), "application/json", "{path}");
    }
    for path in ["/v1/", "/v1/robot", "//", "//other.example/x"] {
        let page = request(address, browser, "GET", path, None).await;
        assert_eq!(page.status, 401, "{path}: the API is told to a known caller alone");
    }
    let post = request(address, browser, "POST", "/robots/press/no/page/there", None).await;
    assert_eq!(post.status, 401);
}
