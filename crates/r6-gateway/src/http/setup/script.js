"use strict";

// The link is /setup#SECRET for the first admin, and /setup#SECRET&NAME for a user who is there.
const [secret, name] = location.hash.slice(1).split("&");
history.replaceState(null, "", location.pathname);

// The dashboard does the same in the language of the browser, and then asks the user to sign in. A build without it
// has this page alone.
if (secret) {
  fetch("/", { cache: "no-store" })
    .then((answer) => {
      if (answer.ok) location.replace(`/#link=${secret}${name ? `&${name}` : ""}`);
    })
    .catch(() => {});
}

const byId = (id) => document.getElementById(id);
const say = (text) => { byId("answer").textContent = text; };

if (secret) {
  byId("form").hidden = false;
  if (name) {
    byId("name").value = name;
    byId("name").readOnly = true;
  } else {
    byId("about").textContent = "This link makes the first admin. It works once.";
  }
} else {
  say("Open the whole link, with all that stands behind the #. A link that this page has read is not in its address any more.");
}

byId("form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const password = byId("password").value;
  if (password !== byId("again").value) {
    say("The two passwords differ.");
    return;
  }
  const body = JSON.stringify({ secret, name: byId("name").value, password });
  say("…");
  try {
    const answer = await fetch("/v1/setup", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body,
    });
    if (answer.ok) {
      byId("form").remove();
      say("Done. The user can sign in now.");
    } else {
      say((await answer.json()).message);
    }
  } catch {
    say("The gateway does not answer. Try again.");
  }
});
