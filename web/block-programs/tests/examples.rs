//! Checks that the table of blocks has its texts in both languages, and that the programs in `examples/` use every block. Other
//! tests run these programs.

#![allow(clippy::expect_used, clippy::indexing_slicing)] // A panic is a failed test.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

/// Collects the kinds of all blocks that occur in a JSON value: in definitions, in the toolbox or in a program.
fn kinds(json: &Value, found: &mut BTreeSet<String>) {
    match json {
        Value::Object(members) => {
            let is_block = |kind: &&str| {
                ["arm_", "controls_", "logic_", "math_", "variables_", "procedures_"]
                    .iter()
                    .any(|start| kind.starts_with(start))
            };
            found.extend(members.get("type").and_then(Value::as_str).filter(is_block).map(str::to_owned));
            members.values().for_each(|value| kinds(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| kinds(value, found)),
        _ => {}
    }
}

fn kinds_in(path: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(path).expect("a file");
    let mut found = BTreeSet::new();
    kinds(&serde_json::from_str(&text).expect("JSON"), &mut found);
    found
}

/// Blocks that Blockly itself adds to the toolbox, for variables and functions.
const OFFERED_BY_BLOCKLY: [&str; 7] = [
    "variables_get",
    "variables_set",
    "math_change",
    "procedures_defnoreturn",
    "procedures_defreturn",
    "procedures_ifreturn",
    "procedures_callreturn",
];

#[test]
fn the_examples_have_every_block_that_the_editor_offers() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut offered = kinds_in(&crate_folder.join("../block-editor/blocks.json"));
    offered.extend(OFFERED_BY_BLOCKLY.map(str::to_owned));
    offered.insert("procedures_callnoreturn".to_owned());
    let files = fs::read_dir(crate_folder.join("examples")).expect("a folder");
    let paths = files.map(|entry| entry.expect("an entry").path());
    let examples = paths.filter(|path| path.extension().is_some_and(|extension| extension == "json"));
    let used: BTreeSet<_> = examples.flat_map(|path| kinds_in(&path)).collect();
    let missing: Vec<_> = offered.difference(&used).collect();
    assert!(missing.is_empty(), "no example has {missing:?}");
}

#[test]
fn each_text_of_a_block_is_there_in_both_languages() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../block-editor/blocks.json");
    let text = fs::read_to_string(path).expect("a file");
    let table: Value = serde_json::from_str(&text).expect("JSON");
    let named = text.split("%{BKY_").skip(1).filter_map(|rest| rest.split('}').next());
    for name in named {
        for language in ["en", "zh-CN"] {
            assert!(table["texts"][name][language].is_string(), "{name} in {language}");
        }
    }
}
