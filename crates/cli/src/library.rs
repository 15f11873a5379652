//! `cvg effects`: the library of effects, as its own descriptions tell it.

use std::fmt::Write as _;

use cvg_calibration::report::named::{self, BESIDE_THE_LIBRARY, Beside};
use cvg_model::effects::{Description, EffectId, Role, Scaling};
use serde_json::{Value, json};

use crate::{Failure, output};

/// Prints the library, or one effect of it.
pub(crate) fn effects(effect: Option<&str>, as_json: bool, as_markdown: bool) -> Result<(), Failure> {
    if let Some(beside) = BESIDE_THE_LIBRARY.iter().find(|e| effect == Some(e.id)) {
        let as_text = || serde_json::to_string_pretty(&[beside_facts(beside)]).map_err(Failure::input);
        let text = if as_json { format!("{}\n", as_text()?) } else { beside_in_full(beside) };
        return output::answer(&text);
    }
    let chosen: Vec<&Description> = match effect {
        None => EffectId::ALL.iter().map(|e| e.description()).collect(),
        Some(id) => vec![EffectId::from_id(id).ok_or_else(|| unknown(id))?.description()],
    };
    if as_json {
        output::answer(&format!("{}\n", as_json_text(&chosen)?))?;
    } else if as_markdown {
        output::answer(&page())?;
    } else if effect.is_some() {
        for d in chosen {
            output::answer(&in_full(d))?;
        }
    } else {
        for d in chosen {
            output::answer(&listed(d.id, &stage(d), d.title))?;
        }
        output::answer("\nIn reports alone, of no file of the library:\n")?;
        for e in BESIDE_THE_LIBRARY {
            output::answer(&listed(e.id, e.stage, &format!("{} ({})", e.title, e.of)))?;
        }
    }
    Ok(())
}

fn listed(id: &str, stage: &str, title: &str) -> String {
    format!("{id:<30}{stage:<11}{title}\n")
}

/// The library as JSON.
pub(crate) fn all_as_json() -> Result<String, Failure> {
    as_json_text(&EffectId::ALL.iter().map(|e| e.description()).collect::<Vec<_>>())
}

fn as_json_text(chosen: &[&Description]) -> Result<String, Failure> {
    let all: Vec<Value> = chosen.iter().map(|d| facts(d)).collect();
    serde_json::to_string_pretty(&all).map_err(Failure::input)
}

/// Prints an effect of the library as an effect file.
pub(crate) fn export(id: &str) -> Result<(), Failure> {
    let effect = EffectId::from_id(id).ok_or_else(|| unknown(id))?;
    let text = cvg_calibration::export(effect)?.to_text();
    output::answer(&format!(
        "# {id} as the library has it. Give it an id of its own before it competes with the library.\n{text}"
    ))
}

fn unknown(id: &str) -> Failure {
    let ids: Vec<&str> = EffectId::ALL.iter().map(|e| e.description().id).collect();
    let beside = BESIDE_THE_LIBRARY.map(|e| e.id).join(", ");
    Failure::input(format!(
        "the library has no effect `{id}`; it has {}, and reports have beside it {beside}",
        ids.join(", ")
    ))
}

fn stage(d: &Description) -> String {
    format!("{:?}", d.stage).to_lowercase()
}

fn origin(d: &Description) -> &'static str {
    match (d.declared, d.empirical) {
        (true, _) => "declared",
        (false, true) => "empirical",
        (false, false) => "discovered",
    }
}

fn role(role: Role) -> &'static str {
    match role {
        Role::Fitted => "fitted",
        Role::Refined => "held at its neutral value until the data asks for it",
        Role::Searched(_) => "set by a search",
        Role::Located(_) => "found by a search, then fitted",
        Role::Chosen(_) => "one of a few values, each tried",
    }
}

/// How the share in the angle scales, in words.
fn scaling(s: Scaling) -> String {
    let power = |of: &str, n: i8| match n {
        0 => format!("independent of the {of}"),
        1 => format!("∝ {of}"),
        -1 => format!("∝ 1/{of}"),
        n => format!("∝ {of}^{n}"),
    };
    if (s.rate, s.amplitude) == (0, 0) {
        let odd = if s.odd_in_rate { "; its sign follows the rate's" } else { "" };
        return format!("independent of rate and amplitude{odd}");
    }
    let odd = if s.odd_in_rate { ", its sign follows the rate's" } else { "" };
    format!("{}, {}{odd}", power("rate", s.rate), power("amplitude", s.amplitude))
}

fn facts(d: &Description) -> Value {
    let parameters: Vec<Value> = d
        .parameters
        .iter()
        .map(|p| {
            json!({"name": p.name, "unit": p.unit, "lower": p.lower, "upper": p.upper, "neutral": p.neutral,
                   "role": role(p.role)})
        })
        .collect();
    json!({
        "id": d.id, "title": d.title, "stage": stage(d), "origin": origin(d), "in_sensors": d.in_sensors,
        "parameters": parameters, "reported": as_reported(&named::of_effect(d)), "signature": d.signature, "source": d.source,
        "scaling": {"rate": d.scaling.rate, "amplitude": d.scaling.amplitude, "odd_in_rate": d.scaling.odd_in_rate},
    })
}

/// Names of numbers in a report, as JSON.
fn as_reported(names: &[(&str, &str)]) -> Vec<Value> {
    names.iter().map(|(name, unit)| json!({"name": name.replace('#', "N"), "unit": unit})).collect()
}

fn beside_facts(e: &Beside) -> Value {
    json!({"id": e.id, "title": e.title, "stage": e.stage, "reports_of": e.of, "reported": as_reported(e.parameters)})
}

fn in_full(d: &Description) -> String {
    let mut s = format!("{}: {}\n", d.id, d.title);
    let mut line = |what: &str, value: &str| {
        let _ = writeln!(s, "  {what:<22}{value}");
    };
    line("acts in", &stage(d));
    line("origin", origin(d));
    line("signature", d.signature);
    line("scaling", &scaling(d.scaling));
    for p in d.parameters {
        let bounds = format!("{} [{}], {} to {}, {}", p.name, p.unit, p.lower, p.upper, role(p.role));
        line("parameter", &bounds);
    }
    line("reported as", &reported(&named::of_effect(d)));
    line("simulated in sensors", if d.in_sensors { "yes" } else { "no" });
    line("source", d.source);
    s
}

/// An effect that reports have beside the library's, and the names of its numbers there.
fn beside_in_full(e: &Beside) -> String {
    format!(
        "{}: {}\n  {:<22}{}\n  {:<22}{}\n  {:<22}reports of {} alone\n",
        e.id,
        e.title,
        "acts in",
        e.stage,
        "reported as",
        reported(e.parameters),
        "in",
        e.of
    )
}

/// The names of numbers in a report, with their units.
fn reported(names: &[(&str, &str)]) -> String {
    let each: Vec<String> = names.iter().map(|(name, unit)| format!("{} [{unit}]", name.replace('#', "N"))).collect();
    each.join(", ")
}

/// The same for the book.
fn coded(names: &[(&str, &str)]) -> String {
    let each: Vec<String> = names.iter().map(|(name, unit)| format!("`{}` [{unit}]", name.replace('#', "N"))).collect();
    each.join(", ")
}

/// The page of the book.
fn page() -> String {
    let mut s = String::from(
        "# Effects\n\nWhat a recording can hold. This page is printed by `cvg effects --markdown` from\n\
         `crates/model/src/effects`, one file per effect, with what of it may follow the temperature; a test compares the two.\n`cvg effects ID` shows one in full.\n\n\
         An effect acts in one of four stages: on the **input** rotation, in the **mechanics**, in the **actuation**, or in \
         the\n**readout**. `a` is the amplitude, θ the pattern angle, α the angle of the table, k the angular gain, Ω the \
         rate. Signatures\nare for small effects.\n\n\
         | effect | stage | origin | parameters | signature | share in the angle |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for e in EffectId::ALL {
        let d = e.description();
        let parameters: Vec<String> = d.parameters.iter().map(|p| format!("`{}` [{}]", p.name, p.unit)).collect();
        let cell = |text: &str| text.replace('|', "\\|");
        let _ = writeln!(
            s,
            "| `{}` | {} | {} | {} | {} | {} |",
            d.id,
            stage(d),
            origin(d),
            parameters.join(", "),
            cell(d.signature),
            scaling(d.scaling)
        );
    }
    s.push_str(LOOK_ALIKES);
    s.push_str(
        "\n## In reports alone\n\nOf no file of the library. N is a number from 1 on.\n\n\
         | effect | stage | in reports of | numbers | what it is |\n| --- | --- | --- | --- | --- |\n",
    );
    for e in BESIDE_THE_LIBRARY {
        let _ = writeln!(s, "| `{}` | {} | {} | {} | {} |", e.id, e.stage, e.of, coded(e.parameters), e.title);
    }
    s.push_str("\n## Names in reports\n\nReports show a pair of parameters as a magnitude and an angle, by names of their own:\n\n");
    s.push_str("| effect | in reports |\n| --- | --- |\n");
    for d in EffectId::ALL.iter().map(|e| e.description()) {
        let names = named::of_effect(d);
        if names != d.parameters.iter().map(|p| (p.name, p.unit)).collect::<Vec<_>>() {
            let _ = writeln!(s, "| `{}` | {} |", d.id, coded(&names));
        }
    }
    s
}

const LOOK_ALIKES: &str = "
*Declared* effects are the paper's model. *Discovered* ones are taken from the library where the residual asks for them.
*Empirical* ones describe what no physical effect explains, and claim no cause; nor does a `table-harmonic` of a high or
broken order, nor any effect that a run, the energy balance or a rival contradicts. The definitions at signal level are in
[Theory](theory.md#the-effects-at-signal-level).

## Look-alikes

At one rate and one amplitude the following cannot be told apart:

- `detection-gain-mismatch`, and the sine part of `anisodamping`;
- `detection-skew`, and the cosine part of `anisodamping`;
- `temperature`, and the sine part of `anisodamping-temperature`; `skew-temperature`, and its cosine part;
- `detection-cubic`, and `spring-cubic`;
- the difference part of `detection-cubic`, and `detection-gain-mismatch`;
- `detection-cubic`, and `detection-quintic`, which is reported as a cubic;
- `detection-phase`, and `spring-cubic`, where v_qc and the quadrature were not recorded;
- `drive-saturation`, and `spring-cubic`, where the commands were not recorded.

At any rate and any amplitude neither can these:

- `actuation-phase`, and `anisodamping`, where v_as was not recorded;
- `drive-feedthrough`, and `detection-gain-mismatch` or `detection-skew`, without a ring-down, in which the drives are silent;
- `temperature`, and `gain-drift`; `scale-temperature`, and `scale-drift`: where the temperature went with the time.

What separates them is in [Prepare a campaign](campaigns.md). How an effect is added is in
[Add an effect](adding-an-effect.md).
";
