//! The attributes of Kani's interface: `proof` adds a test that samples the harness, the others are notes to a prover.
//!
//! A harness has no arguments, so its tokens are enough; nothing is parsed beyond its name and `should_panic`.

use proc_macro::{TokenStream, TokenTree};

/// Marks a harness. The function stays as it is; under `cargo test` a test `sampled_<name>` drives it.
#[proc_macro_attribute]
pub fn proof(_arguments: TokenStream, harness: TokenStream) -> TokenStream {
    let Some(name) = name(&harness) else {
        return "compile_error!(\"#[kani::proof] marks a function\");".parse().unwrap_or_default();
    };
    let expected = if should_panic_follows(&harness) { "Refuted" } else { "Holds" };
    let test = format!(
        "#[cfg(test)] #[test] fn sampled_{name}() {{ \
             ::kani::drive(concat!(module_path!(), \"::{name}\"), ::kani::Expected::{expected}, {name}); \
         }}"
    );
    let mut out = harness;
    out.extend(test.parse::<TokenStream>().unwrap_or_default());
    out
}

/// The harness is a twin: it holds an error that has to be found.
#[proc_macro_attribute]
pub fn should_panic(_arguments: TokenStream, harness: TokenStream) -> TokenStream {
    harness
}

/// How often a loop may run at most.
#[proc_macro_attribute]
pub fn unwind(_arguments: TokenStream, harness: TokenStream) -> TokenStream {
    harness
}

/// Which solver is quickest.
#[proc_macro_attribute]
pub fn solver(_arguments: TokenStream, harness: TokenStream) -> TokenStream {
    harness
}

fn name(harness: &TokenStream) -> Option<String> {
    let mut tokens = harness.clone().into_iter();
    tokens.find(|token| matches!(token, TokenTree::Ident(i) if i.to_string() == "fn"))?;
    tokens.next().map(|token| token.to_string())
}

/// An attribute `should_panic` stands between `proof` and the function.
fn should_panic_follows(harness: &TokenStream) -> bool {
    harness
        .clone()
        .into_iter()
        .take_while(|token| !matches!(token, TokenTree::Ident(i) if i.to_string() == "fn"))
        .any(|token| matches!(&token, TokenTree::Group(g) if g.stream().to_string().contains("should_panic")))
}
