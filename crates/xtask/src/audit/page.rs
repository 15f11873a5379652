//! `audit.html`: the same for people.

use std::fmt::Write as _;

use super::claims::Meets;
use super::record::{Evidence, Judged, Record, Results, Status, Twin};

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem;color:#222}\
    h1,h2{line-height:1.2}h3{margin:1.6rem 0 .2rem;font-size:1rem}table{border-collapse:collapse;width:100%;font-size:.86rem}\
    td,th{border-bottom:1px solid #ddd;padding:.25rem .5rem;text-align:left;vertical-align:top;overflow-wrap:anywhere}\
    .bad{background:#fdd}.note{color:#555;margin:.1rem 0}code{font-size:.92em}@media(prefers-color-scheme:dark){\
    body{background:#181818;color:#ddd}td,th{border-color:#444}.bad{background:#622}.note{color:#aaa}}";

/// Text made safe for HTML; what stands in backticks is set as code.
fn escaped(text: &str) -> String {
    let safe = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    let parts = safe.split('`').enumerate();
    parts.map(|(i, part)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() }).collect()
}

/// The whole page.
pub(crate) fn render(record: &Record, results: &Results, faults: &[String]) -> String {
    let verdict = if faults.is_empty() { "Everything that is named has run and passed." } else { "The audit failed." };
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Audit</title><style>{STYLE}</style>\
         <h1>Audit</h1><p><strong>{verdict}</strong> {}</p>",
        escaped(&record.summary())
    );
    page += "<p class=\"note\">Results are those of this run, as the runners printed them. What each kind of evidence is worth, \
        and what has to be believed, stands in docs/src/audit.md.</p>";
    if !faults.is_empty() {
        page += "<h2>Faults</h2><ul>";
        for fault in faults {
            let _ = write!(page, "<li class=\"bad\">{}</li>", escaped(fault));
        }
        page += "</ul>";
    }
    for (chapter, all) in &record.chapters {
        let _ = write!(page, "<h2>{}</h2>", escaped(&chapter.title));
        if let Some(reason) = &chapter.without_bits {
            let _ = write!(page, "<p class=\"note\">No bit-precise proof: {}</p>", escaped(reason));
        }
        for judged in all {
            requirement(&mut page, judged);
        }
    }
    page += "<h2>Bit-precise harnesses that show no requirement</h2>";
    page += "<p class=\"note\">Guards of the route, and claims beyond the requirements.</p><table>";
    let cited: Vec<_> = record.evidence().map(|(_, e)| e.name.as_str()).collect();
    for p in results.proofs.iter().filter(|p| !cited.contains(&p.name.as_str())) {
        let twin = if p.twin_rejected { "rejected" } else { "accepted" };
        let cells = [&p.name, &p.engine, &p.claim, &p.assumptions.join("; "), &p.status.to_string(), twin];
        row(&mut page, &cells, p.status != Status::Passed || !p.twin_rejected);
    }
    page + "</table></html>\n"
}

fn requirement(page: &mut String, judged: &Judged) {
    let r = &judged.requirement;
    let _ = write!(
        page,
        "<h3 id=\"{0}\"><code>{0}</code></h3><p>{1}</p><p class=\"note\">Domain: {2}<br>Function: {3}</p>",
        escaped(&r.id),
        escaped(&r.text),
        escaped(&r.domain),
        judged.functions.iter().map(function).collect::<Vec<_>>().join("<br>")
    );
    if let Some(reason) = &r.not_flown {
        let _ = write!(page, "<p class=\"note\">Not in the instrument: {}</p>", escaped(reason));
    }
    let proved = judged.evidence.iter().any(|e| e.kind.is_proof());
    if let Some(reason) = &r.not_proved {
        let label = if proved { "Not proved beyond what stands below" } else { "Not proved" };
        let _ = write!(page, "<p class=\"note\">{label}: {}</p>", escaped(reason));
    }
    *page += "<table><tr><th>kind</th><th>name</th><th>engine</th><th>says</th><th>assumes beyond the domain</th>\
        <th>result</th><th>twin</th></tr>";
    for e in &judged.evidence {
        evidence(page, e);
    }
    *page += "</table>";
}

/// A function, and who calls it in the instrument.
fn function(f: &Meets) -> String {
    let caller = f.called.as_ref().map_or("not called in the instrument".to_owned(), |chain| {
        if chain.len() > 1 { format!("called by {}", chain.join(" → ")) } else { "called by the firmware".to_owned() }
    });
    format!("{} ({}), {}", escaped(&f.name), escaped(&f.place), escaped(&caller))
}

fn evidence(page: &mut String, e: &Evidence) {
    let says = if e.details.is_empty() { e.claim.clone() } else { format!("{} [{}]", e.claim, e.details) };
    let kind = format!("{:?}", e.kind).to_lowercase();
    let twin = if e.kind.is_proof() { format!("{:?}", e.twin).to_lowercase() } else { String::new() };
    let bad = e.status != Status::Passed || e.kind.is_proof() && e.twin != Twin::Rejected;
    let cells = [&kind, &e.name, &e.engine, &says, &e.assumptions.join("; "), &e.status.to_string(), &twin];
    row(page, &cells.map(String::as_str), bad);
}

fn row(page: &mut String, cells: &[&str], bad: bool) {
    *page += if bad { "<tr class=\"bad\">" } else { "<tr>" };
    for cell in cells {
        let _ = write!(page, "<td>{}</td>", escaped(cell));
    }
    *page += "</tr>";
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escaped("a<b> & `c<d`"), "a&lt;b&gt; &amp; <code>c&lt;d</code>");
    }
}
