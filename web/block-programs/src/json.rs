//! Blockly's JSON of a workspace: blocks, their fields and their connections. This file does not know the kinds of blocks.
//!
//! In this JSON each block contains the block below it, so that a long stack of blocks is deeply nested. To bound the recursion
//! of the parser, a connection stays unparsed text until it is followed.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;
use serde_json::value::RawValue;

use crate::fault::{BlockId, ProgramError, ProgramFault};

/// The largest workspace, in bytes: more than a person builds. The time to parse a stack grows with the square of its length.
const LARGEST: usize = 200_000;

#[derive(Deserialize)]
pub(crate) struct BlocklyWorkspace<'a> {
    #[serde(borrow, default)]
    blocks: TopBlocks<'a>,
    #[serde(default)]
    pub(crate) variables: Vec<VariableModel>,
}

#[derive(Default, Deserialize)]
struct TopBlocks<'a> {
    #[serde(borrow, default)]
    blocks: Vec<&'a RawValue>,
}

#[derive(Deserialize)]
pub(crate) struct VariableModel {
    pub(crate) id: String,
    pub(crate) name: String,
}

/// A block. The blocks in its inputs and below it are not parsed yet.
#[derive(Deserialize)]
pub(crate) struct BlocklyBlock<'a> {
    #[serde(rename = "type")]
    pub(crate) kind: String,
    #[serde(default = "no_id")]
    pub(crate) id: BlockText,
    #[serde(default)]
    fields: BTreeMap<String, Value>,
    #[serde(borrow, default)]
    inputs: BTreeMap<String, BlockConnection<'a>>,
    #[serde(borrow, default)]
    next: Option<BlockConnection<'a>>,
    /// The state of a block with a variable shape, such as the number of its branches or the parameters of its function.
    #[serde(default, rename = "extraState")]
    pub(crate) extra: Value,
    #[serde(default, rename = "disabledReasons")]
    disabled_reasons: Vec<Value>,
    enabled: Option<bool>,
}

/// A [`BlockId`] that serde can parse from a string.
#[derive(Deserialize)]
#[serde(from = "String")]
pub(crate) struct BlockText(pub(crate) BlockId);

impl From<String> for BlockText {
    fn from(text: String) -> Self {
        Self(text.into())
    }
}

fn no_id() -> BlockText {
    BlockText("".into())
}

#[derive(Deserialize)]
struct BlockConnection<'a> {
    #[serde(borrow)]
    block: Option<&'a RawValue>,
    #[serde(borrow)]
    shadow: Option<&'a RawValue>,
}

impl<'a> BlockConnection<'a> {
    /// The connected block, or else the shadow block: Blockly's default value of an input.
    fn block(&self) -> Result<Option<BlocklyBlock<'a>>, ProgramError> {
        self.block.or(self.shadow).map(block).transpose()
    }
}

fn block(text: &RawValue) -> Result<BlocklyBlock<'_>, ProgramError> {
    serde_json::from_str(text.get()).map_err(no_workspace)
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn no_workspace(error: serde_json::Error) -> ProgramError {
    ProgramFault::NotAWorkspace(error.to_string()).of_workspace()
}

impl<'a> BlocklyWorkspace<'a> {
    pub(crate) fn of(text: &'a str) -> Result<Self, ProgramError> {
        if text.len() > LARGEST {
            return Err(ProgramFault::TooLarge.of_workspace());
        }
        serde_json::from_str(text).map_err(no_workspace)
    }

    /// The blocks that no other block contains.
    pub(crate) fn top_blocks(&self) -> Result<Vec<BlocklyBlock<'a>>, ProgramError> {
        self.blocks.blocks.iter().map(|&text| block(text)).collect()
    }
}

impl<'a> BlocklyBlock<'a> {
    pub(crate) fn fault(&self, fault: ProgramFault) -> ProgramError {
        fault.at(&self.id.0)
    }

    pub(crate) fn is_enabled(&self) -> bool {
        self.disabled_reasons.is_empty() && self.enabled != Some(false)
    }

    /// The block in an input; `None` if the input is empty or its block is disabled.
    pub(crate) fn input(&self, name: &str) -> Result<Option<BlocklyBlock<'a>>, ProgramError> {
        let block = self.inputs.get(name).map(BlockConnection::block).transpose()?.flatten();
        Ok(block.filter(BlocklyBlock::is_enabled))
    }

    /// The block below this one, also if it is disabled.
    pub(crate) fn next(&self) -> Result<Option<BlocklyBlock<'a>>, ProgramError> {
        Ok(self.next.as_ref().map(BlockConnection::block).transpose()?.flatten())
    }

    /// The value of a field that holds a text.
    pub(crate) fn text(&self, field: &str) -> Result<&str, ProgramError> {
        self.fields.get(field).and_then(Value::as_str).ok_or_else(|| self.bad_field(field))
    }

    /// The value of a field that holds a number.
    pub(crate) fn number(&self, field: &str) -> Result<f64, ProgramError> {
        self.fields.get(field).and_then(Value::as_f64).ok_or_else(|| self.bad_field(field))
    }

    /// The identifier of the variable in a field.
    pub(crate) fn variable(&self, field: &str) -> Result<&str, ProgramError> {
        let id = self.fields.get(field).and_then(|value| value.get("id")).and_then(Value::as_str);
        id.ok_or_else(|| self.bad_field(field))
    }

    /// Looks up the name that a field holds, and returns the choice of this name.
    pub(crate) fn choice<T: Copy>(&self, field: &str, choices: &[(&str, T)]) -> Result<T, ProgramError> {
        let name = self.text(field)?;
        let found = choices.iter().find(|(known, _)| *known == name);
        found.map(|(_, choice)| *choice).ok_or_else(|| self.bad_field(field))
    }

    pub(crate) fn bad_field(&self, field: &str) -> ProgramError {
        self.fault(ProgramFault::BadField(field.to_owned()))
    }
}
