/* What the grid of projects shows in its cells. Texts are texts: React escapes them, no HTML is built. */
"use strict";

var dagfuncs = (window.dashAgGridFunctions = window.dashAgGridFunctions || {});
var dagcomponents = (window.dashAgGridComponentFunctions = window.dashAgGridComponentFunctions || {});

(function () {
  const MINUTE = 60, HOUR = 3600, DAY = 86400;

  /* Symbols differ in shape, so that nobody needs the colours. */
  const STATES = {
    Completed: ["passed", "✓"], GateFailed: ["gate", "▲"], InputError: ["input", "✎"],
    NotComputable: ["input", "∅"], Failed: ["broken", "✗"], TimedOut: ["broken", "✗"],
    Crashed: ["broken", "✗"], Cancelled: ["broken", "■"], Running: ["running", "▶"],
    Scheduled: ["waiting", "◷"],
  };
  const STAGES = { done: "✓", reused: "↺", failed: "✗", running: "▶", waiting: "–" };
  const LABELS = {
    "report.html": "report", "certificate.html": "cert.",
    "georeferencing_check.html": "check", "sweep.html": "sweep",
    "image_quality.html": "quality", "radiometric_certificate.html": "cert.",
  };
  const RUN = /^[0-9a-f-]{36}$/;

  function spoken(seconds) {
    if (seconds < 9.95) return seconds.toFixed(1) + " s";
    if (seconds < 99.5) return seconds.toFixed(0) + " s";
    if (seconds < 99 * MINUTE) return (seconds / MINUTE).toFixed(0) + " min";
    if (seconds < 36 * HOUR) return (seconds / HOUR).toFixed(0) + " h";
    return (seconds / DAY).toFixed(0) + " d";
  }

  dagfuncs.age = function (time) {
    if (!time) return "";
    const now = Date.now() - window.aerocal.answer.ahead;
    return spoken(Math.max(0, (now - Date.parse(time)) / 1000));
  };

  dagfuncs.duration = function (params) {
    if (params.value !== undefined && params.value !== null) return spoken(params.value);
    return params.data && params.data.begun ? dagfuncs.age(params.data.begun) + " …" : "";
  };

  dagfuncs.fixed = function (value, decimals) {
    return value === undefined || value === null ? "" : Number(value).toFixed(decimals);
  };

  dagfuncs.beyond = function (params, column) {
    return Boolean(params.data && params.data.beyond && params.data.beyond.includes(column));
  };

  /* Most failed gates first. */
  dagfuncs.byGates = function (a, b) {
    const missed = (text) => (text ? (text.split(":")[1] || "").split(",").filter(Boolean).length : -1);
    return missed(a) - missed(b);
  };

  /* A spreadsheet would carry out what begins like a formula. */
  dagfuncs.csvCell = function (params) {
    const text = params.value === undefined || params.value === null ? "" : params.value;
    return typeof text === "string" && /^[=+\-@\t\r]/.test(text) ? "'" + text : text;
  };

  function element(kind, properties, ...children) {
    return React.createElement(kind, properties, ...children);
  }

  function link(address, text, title) {
    return element("a", {
      href: address, target: "_blank", rel: "noopener noreferrer", title: title, key: address,
      onClick: (event) => event.stopPropagation(),
    }, text);
  }

  dagcomponents.StateCell = function (props) {
    const [kind, symbol] = STATES[props.value] || ["waiting", "?"];
    return element("span", { className: "pill " + kind },
      element("span", { className: "symbol", "aria-hidden": true }, symbol), props.value);
  };

  dagcomponents.StageCell = function (props) {
    if (!props.value) return null;
    const words = props.stage + ": " + (props.value === "waiting" ? "not yet" : props.value);
    return element("span", {
      className: "stage-" + props.value, title: words, role: "img", "aria-label": words,
    }, STAGES[props.value] || "?");
  };

  dagcomponents.GatesCell = function (props) {
    if (!props.value) return null;
    const [count, failed] = String(props.value).split(/: (.*)/s);
    if (!failed) return element("span", { className: "gates-passed" }, count);
    return element("span", { className: "gates-failed" }, "▲ " + count + ": ", element("b", null, failed));
  };

  dagcomponents.LinksCell = function (props) {
    const row = props.data;
    if (!row || !RUN.test(row.run)) return null;
    const documents = (row.documents || []).map((name) => link(
      "/results/" + encodeURIComponent(row.run) + "/" + encodeURIComponent(name),
      LABELS[name] || name, name + " of " + row.project));
    const run = link(window.aerocal.runPage(props.dashboard, row.run), "run", "the run in Prefect");
    return element("span", { className: "links" }, ...documents, run);
  };
})();
