// Opens a report in headless Chromium and fails where a reader would: errors in the console, anything fetched, figures
// that are not drawn, switches that do nothing, serious findings of axe, a file too large or too slow to open.
// Usage: node report.mjs REPORT.html SCREENSHOT_FOLDER
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import axe from "axe-core";
import { chromium } from "playwright-core";

const LARGEST_BYTES = 2_000_000;
// the work until the first figure can be read, and until all can, as multiples of that of a page with one figure of two points
// and the same library: a fifth above the most that eleven runs took, 2.03 and 5.09
const MOST_WORK = 2.5;
const MOST_WORK_FOR_ALL = 6.2;
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

// The smallest page that draws with the library of the report: what no report can be faster than on this machine.
const smallest = resolve(folder, "smallest.html");
const library = readFileSync(report, "utf8").match(/<script type="text\/javascript">[\s\S]*?<\/script>/)[0];
writeFileSync(
  smallest,
  `<!doctype html><title>one figure</title><div id="plot-one" class="plot" style="height:400px"></div>${library}
<script>Plotly.newPlot("plot-one", [{ x: [1, 2], y: [1, 2] }]).then((p) => {
p.dataset.drawn = document.documentElement.dataset.ready = "true"; });</script>`,
);

// Loads a page, and gives the processor time of its main thread, which other work on the machine does not lengthen: until
// its first figure can be read, and until all can. What the page leaves for when nothing is asked of it is held back between.
async function load(context, page, file) {
  const session = await context.newCDPSession(page);
  await session.send("Performance.enable", { timeDomain: "threadTicks" });
  await page.addInitScript(() => {
    const idle = window.requestIdleCallback.bind(window);
    const held = [];
    window.requestIdleCallback = (callback, options) => held.push([callback, options]);
    window.release = () => {
      window.requestIdleCallback = idle;
      held.forEach(([callback, options]) => idle(callback, options));
    };
  });
  await page.goto(pathToFileURL(file).href, { waitUntil: "load" });
  await page.waitForSelector(".plot[data-drawn]", { timeout: 30000 });
  const work_ms = async () => {
    const { metrics } = await session.send("Performance.getMetrics");
    return 1000 * metrics.find((m) => m.name === "TaskDuration").value;
  };
  const first_ms = await work_ms();
  assert.equal(await page.locator(".plot[data-drawn]").count(), 1, "figures that nobody waits for are drawn with the first");
  await page.evaluate(() => window.release());
  await page.waitForSelector("html[data-ready]", { timeout: 60000 });
  return { first_ms, all_ms: await work_ms() };
}

const worked_ms = [];
const least_ms = [];

async function open(width, colorScheme) {
  const bare = await browser.newContext({ viewport: { width, height: 900 }, colorScheme });
  least_ms.push((await load(bare, await bare.newPage(), smallest)).first_ms);
  await bare.close();
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme });
  const page = await context.newPage();
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && complaints.push(`${width} ${colorScheme}: ${m.text()}`));
  page.on("pageerror", (e) => complaints.push(`${width} ${colorScheme}: ${e}`));
  page.on("request", (r) => {
    if (!/^(file|data|blob):/.test(r.url())) complaints.push(`fetches ${r.url()}`);
  });
  worked_ms.push(await load(context, page, report));
  return { context, page };
}

try {
  for (const scheme of ["light", "dark"]) {
    for (const width of WIDTHS) {
      const { context, page } = await open(width, scheme);
      assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), scheme);
      const empty = await page.$$eval(".plot", (all) => all.filter((p) => !p.querySelector("svg .trace, svg .hm")).map((p) => p.id));
      assert.deepEqual(empty, [], `${width} ${scheme}: figures without anything drawn`);
      const inks = await page.$$eval("#plot-correlations", (all) => all.flatMap((p) => p._fullLayout.shapes.map((c) => c.fillcolor)));
      assert.ok(inks.every((ink) => /^#[0-9a-f]{6}$/.test(ink)), `${width} ${scheme}: colours ${inks}`);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(overflow <= 0, `${width} ${scheme}: the page is ${overflow} px too wide`);
      const beyond = await page.$$eval("main > .scroll, main > section .scroll", (all) =>
        all.filter((s) => s.scrollWidth > s.clientWidth + 1).map((s) => s.getAttribute("aria-label")));
      assert.ok(width > 600 || beyond.length === 0, `${width} ${scheme}: tables cut off: ${beyond}`);
      // cells of a narrow page say their column themselves
      const heads = await page.$$eval("main > .scroll thead", (all) => all.filter((t) => t.getBoundingClientRect().width > 1).length);
      assert.ok(width > 600 || heads === 0, `${width} ${scheme}: ${heads} heads of tables lie over their first rows`);
      const cut = await page.$$eval(".plot", (plots) => plots.flatMap((plot) => {
        const frame = plot.getBoundingClientRect();
        return [...plot.querySelectorAll("svg text")].filter((text) => {
          const box = text.getBoundingClientRect();
          return box.width > 0 && (box.left < frame.left - 1 || box.right > frame.right + 1);
        }).map((text) => `${plot.id}: ${text.textContent}`);
      }));
      assert.deepEqual(cut, [], `${width} ${scheme}: words of figures cut off`);
      const unread = await page.$$eval(".plot", (plots) => plots.flatMap((plot) => {
        const found = [];
        const boxes = (selector) => [...plot.querySelectorAll(selector)].map((text) => ({ text: text.textContent, box: text.getBoundingClientRect() }))
          .filter(({ box }) => box.width > 0);
        // labels of one axis, and of the axes beside it, lie in no order
        for (const kind of [".xtick text, .x2tick text", ".ytick text, .y2tick text"]) {
          const labels = boxes(kind);
          labels.forEach((a, i) => labels.slice(i + 1).forEach((b) => {
            const over = (low, high) => Math.min(a.box[high], b.box[high]) - Math.max(a.box[low], b.box[low]);
            // those that are turned have boxes that are larger than their letters
            const turned = Math.min(a.box.height, b.box.height) > 24;
            if (!turned && over("left", "right") > 1 && over("top", "bottom") > 3) found.push(`${plot.id}: ${a.text} over ${b.text}`);
          }));
        }
        // a number before a letter is a number of one more digit to those who read quickly
        boxes(".xtick text").filter(({ text }) => /^\d+θ$/.test(text)).forEach(({ text }) => found.push(`${plot.id}: ${text} for a harmonic`));
        // titles of axes
        const titles = boxes(".xtitle, .x2title, .ytitle, .y2title");
        const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
        titles.forEach((a, i) => titles.slice(i + 1).filter((b) => meet(a.box, b.box)).forEach((b) => found.push(`${plot.id}: ${a.text} over ${b.text}`)));
        // panels: those of axes that lie over others on purpose are the same panel
        const own = Object.values(plot._fullLayout._plots).filter(({ yaxis: y, xaxis: x }) => !y.overlaying && !x.overlaying);
        const panels = own.map(({ id, xaxis: x, yaxis: y }) => ({ id, left: x._offset, right: x._offset + x._length, top: y._offset, bottom: y._offset + y._length }));
        panels.forEach((a, i) => panels.slice(i + 1).filter((b) => meet(a, b)).forEach((b) => found.push(`${plot.id}: panel ${a.id} over panel ${b.id}`)));
        // and no room that is nobody's: the panels fill their figure, but for what is written between them
        const gap = (p) => p.top - Math.max(...panels.filter((q) => q.bottom <= p.top).map((q) => q.bottom));
        const between = panels.map(gap).filter(Number.isFinite);
        const { _size: size } = plot._fullLayout;
        const below = panels.length > 0 ? size.t + size.h - Math.max(...panels.map((p) => p.bottom)) : 0;
        if (Math.max(below, ...between) > 150) found.push(`${plot.id}: ${Math.max(below, ...between)} px of nothing`);
        // nor over the panel beside theirs
        const { xaxis, yaxis, xaxis2, yaxis2 } = plot._fullLayout;
        if (xaxis2 && yaxis2 && !yaxis2.overlaying) {
          const frame = plot.querySelector("svg.main-svg").getBoundingClientRect();
          const [left, top] = [frame.left + xaxis._offset, frame.top + yaxis._offset];
          const within = ({ box }) => box.right > left + 2 && box.left < left + xaxis._length - 2 && box.bottom > top + 2 && box.top < top + yaxis._length - 2;
          boxes(".y2tick text").filter(within).forEach(({ text }) => found.push(`${plot.id}: ${text} over the first panel`));
        }
        const entries = [...plot.querySelectorAll(".legendtext")].map((text) => text.textContent);
        const twice = entries.filter((entry, at) => entries.indexOf(entry) !== at);
        if (twice.length > 0) found.push(`${plot.id}: ${twice} twice in the legend`);
        const caption = plot.parentElement.querySelector("figcaption");
        const drawn = plot.querySelector("svg.main-svg");
        if (caption && drawn && drawn.getBoundingClientRect().bottom > caption.getBoundingClientRect().top + 1)
          found.push(`${plot.id}: lies over its caption`);
        return found;
      }));
      assert.deepEqual(unread, [], `${width} ${scheme}: words of figures that cannot be read`);
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
  // what else runs on the machine makes either slower, never faster
  const floor_ms = Math.min(...least_ms);
  assert.ok(floor_ms > 0);
  const sorts = [["its first figure", "first_ms", MOST_WORK], ["all of them", "all_ms", MOST_WORK_FOR_ALL]];
  for (const [until, key, most] of sorts) {
    const work_ms = Math.min(...worked_ms.map((worked) => worked[key]));
    const ratio = work_ms / floor_ms;
    console.log(
      `opens with ${ratio.toFixed(2)} times the work of the smallest page until ${until} can be read ` +
        `(${work_ms.toFixed(0)} and ${floor_ms.toFixed(0)} ms, best of ${worked_ms.length})`,
    );
    assert.ok(ratio < most, `${ratio} times the work of the smallest page until ${until} can be read`);
  }
  console.log(`${statSync(report).size} bytes`);
  const raw = page.locator("button[data-series=raw]");
  const switched = (await raw.count()) > 0;
  // the figure that has switches, or the first
  const figure = switched ? `#plot-${await raw.getAttribute("data-of")}` : `#${await page.$eval(".plot", (p) => p.id)}`;
  const shown = () => page.$$eval(`${figure} .scatterlayer .trace`, (all) => all.length);
  const all = await shown();
  const range = () => page.$eval(figure, (p) => p._fullLayout.yaxis.range[1] - p._fullLayout.yaxis.range[0]);
  const wide = await range();
  const count = (n) => page.waitForFunction(([f, n]) => document.querySelectorAll(`${f} .scatterlayer .trace`).length === n, [figure, n]);
  if (switched) {
    // what the stages reach to: where the raw one reaches no further than another, its absence shows nothing larger
    const reach = await page.$eval(figure, (p) => p.data.map((t) => [t.meta, Math.max(...t.y.map(Math.abs))]));
    const further = reach.find(([m]) => m === "raw")[1] > 1.2 * Math.max(...reach.filter(([m]) => m !== "raw").map(([, y]) => y));
    await raw.click();
    await count(all - 1);
    assert.equal(await raw.getAttribute("aria-pressed"), "false");
    const without = await range();
    assert.ok(further ? without < wide : without <= 1.01 * wide, "without the raw stage the others are no smaller");
    await raw.focus();
    await page.keyboard.press("Enter");
    await count(all);
  }
  await page.locator("#theme").click();
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await page.locator(figure).focus();
  const before = await range();
  await page.keyboard.press("+");
  await page.waitForFunction(([f, r]) => {
    const [a, b] = document.querySelector(f)._fullLayout.yaxis.range;
    return b - a < r;
  }, [figure, before]);
  await page.locator(figure).hover();
  await page.locator("#theme").click();
  await page.emulateMedia({ media: "print" });
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.pdf({ path: `${folder}/report.pdf`, format: "A4" });
  await context.close();
  assert.deepEqual(complaints, [], "console, network");
  console.log(`${all} series in ${figure}, screenshots in ${folder}`);
} finally {
  await browser.close();
}
