// Opens a report in headless Chromium and fails where a reader would: errors in the console, anything fetched, figures
// that are not drawn, switches that do nothing, serious findings of axe, a file too large or too slow to open.
// Usage: node report.mjs REPORT.html SCREENSHOT_FOLDER
import assert from "node:assert/strict";
import { existsSync, mkdirSync, statSync } from "node:fs";
import { cpus, loadavg } from "node:os";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import axe from "axe-core";
import { chromium } from "playwright-core";

const LARGEST_BYTES = 8 * 1024 * 1024;
const SLOWEST_OPENING_MS = 2000;
const WIDTHS = [390, 820, 1440];

const [report, folder] = process.argv.slice(2).map((p) => resolve(p));
const executablePath = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);
assert.ok(executablePath, "Chromium is missing: apt-get install chromium, or set CHROMIUM");
mkdirSync(folder, { recursive: true });
assert.ok(statSync(report).size < LARGEST_BYTES, `${statSync(report).size} bytes`);

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
});
const complaints = [];
const openings_ms = [];
// the same by the processor time of the page's main thread, which other work on the machine does not lengthen
const worked_ms = [];

async function open(width, colorScheme) {
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme });
  const page = await context.newPage();
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && complaints.push(`${width} ${colorScheme}: ${m.text()}`));
  page.on("pageerror", (e) => complaints.push(`${width} ${colorScheme}: ${e}`));
  page.on("request", (r) => {
    if (!/^(file|data|blob):/.test(r.url())) complaints.push(`fetches ${r.url()}`);
  });
  const session = await context.newCDPSession(page);
  await session.send("Performance.enable", { timeDomain: "threadTicks" });
  const started = performance.now();
  await page.goto(pathToFileURL(report).href, { waitUntil: "load" });
  // open is: the first figure can be read
  await page.waitForSelector("#plot-bias[data-drawn]", { timeout: 30000 });
  openings_ms.push(performance.now() - started);
  const { metrics } = await session.send("Performance.getMetrics");
  worked_ms.push(1000 * metrics.find((m) => m.name === "TaskDuration").value);
  await page.waitForSelector("html[data-ready]", { timeout: 60000 });
  return { context, page };
}

try {
  for (const scheme of ["light", "dark"]) {
    for (const width of WIDTHS) {
      const { context, page } = await open(width, scheme);
      assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), scheme);
      const empty = await page.$$eval(".plot", (all) => all.filter((p) => !p.querySelector("svg .trace, svg .hm")).map((p) => p.id));
      assert.deepEqual(empty, [], `${width} ${scheme}: figures without anything drawn`);
      const scale = await page.$$eval("#plot-correlations", (all) => all.map((p) => p._fullData[0].colorscale.map((c) => c[1])));
      assert.ok(scale.flat().every((ink) => /^(#|rgb)/.test(ink)), `${width} ${scheme}: colours ${scale}`);
      assert.ok(scale.every((inks) => inks[0] === "#d55e00"), `${width} ${scheme}: not the report's own colours: ${scale}`);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(overflow <= 0, `${width} ${scheme}: the page is ${overflow} px too wide`);
      await page.screenshot({ path: `${folder}/${scheme}-${width}.png`, fullPage: true });
      if (width === 1440) {
        await page.evaluate(axe.source);
        const found = await page.evaluate(() => axe.run(document, { exclude: [[".plot svg"]] }));
        const serious = found.violations.filter((v) => ["serious", "critical"].includes(v.impact));
        const say = serious.map((v) => `${v.id}: ${v.help}: ${v.nodes.slice(0, 3).map((n) => n.html).join(" | ")}`);
        assert.deepEqual(say, [], `${scheme}: axe`);
        console.log(`${scheme}: axe passes ${found.passes.length} rules, ${found.violations.length} lesser findings`);
      }
      await context.close();
    }
  }

  const { context, page } = await open(1440, "light");
  // what else runs on the machine makes it slower, never faster
  const opened_ms = Math.min(...openings_ms);
  const busy = loadavg()[0] > cpus().length;
  const work_ms = Math.min(...worked_ms);
  console.log(
    `opens in ${opened_ms.toFixed(0)} ms (best of ${openings_ms.length}), ${work_ms.toFixed(0)} ms of work, ` +
      `${statSync(report).size} bytes${busy ? "; the machine is busy, the work counts" : ""}`,
  );
  assert.ok(work_ms > 0 && (busy ? work_ms : opened_ms) < SLOWEST_OPENING_MS, `${opened_ms} ms to open, ${work_ms} ms of work`);
  const shown = () => page.$$eval("#plot-bias .scatterlayer .trace", (all) => all.length);
  const all = await shown();
  const range = () => page.$eval("#plot-bias", (p) => p._fullLayout.yaxis.range[1] - p._fullLayout.yaxis.range[0]);
  const wide = await range();
  const raw = page.locator("button[data-series=raw]");
  if ((await raw.count()) > 0) {
    await raw.click();
    await page.waitForFunction((n) => document.querySelectorAll("#plot-bias .scatterlayer .trace").length === n - 1, all);
    assert.equal(await raw.getAttribute("aria-pressed"), "false");
    assert.ok((await range()) < wide, "without the raw stage the others are larger");
    await raw.focus();
    await page.keyboard.press("Enter");
    await page.waitForFunction((n) => document.querySelectorAll("#plot-bias .scatterlayer .trace").length === n, all);
  }
  await page.locator("#theme").click();
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await page.locator("#plot-bias").focus();
  const before = await range();
  await page.keyboard.press("+");
  await page.waitForFunction((r) => {
    const [a, b] = document.getElementById("plot-bias")._fullLayout.yaxis.range;
    return b - a < r;
  }, before);
  await page.locator("#plot-bias").hover();
  await page.locator("#theme").click();
  await page.emulateMedia({ media: "print" });
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.pdf({ path: `${folder}/report.pdf`, format: "A4" });
  await context.close();
  assert.deepEqual(complaints, [], "console, network");
  console.log(`${all} stages, screenshots in ${folder}`);
} finally {
  await browser.close();
}
