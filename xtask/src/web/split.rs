//! Splits the page's module in two: the functions for the first view, and the rest, which the page loads after its first picture.
//!
//! ```text
//!   first ── memory, tables, globals, functions ──▶ rest
//!     ▲                                              │
//!     └── a table, in which the rest enters its functions
//! ```
//!
//! For each function of the rest that the first part or the page calls, the first part contains a short function. That function
//! calls `need_rest` of the page, which loads the rest if necessary. Then it calls the function that the rest has entered in the
//! table. So every choice works that leaves `need_rest` in the first part. A good choice lets the first picture appear before the
//! rest is loaded.

use std::collections::HashSet;

use walrus::ir::{Value, Visitor, dfs_in_order};
use walrus::{
    ConstExpr, Data, Element, ElementItems, ElementKind, Export, ExportItem, Function, FunctionBuilder,
    FunctionId, FunctionKind, Global, GlobalKind, Import, ImportKind, ImportedFunction, Module, ModuleConfig,
    Table, TableId, passes,
};

use crate::run::TaskResult;

/// Parts of the names of functions that the first view does not need.
const LATER: &[&str] = &[
    // Programs, exercises and the class, which read and write JSON.
    "block_programs::",
    "classroom::",
    "exercises::",
    "serde_core::",
    "serde_json::",
    "sevenbot_web::app::class",
    "sevenbot_web::app::exercises::",
    "sevenbot_web::app::programs",
    "sevenbot_web::app::time_line::",
    "sevenbot_web::class",
    "sevenbot_web::preview",
    "sevenbot_web::program",
    "sevenbot_web::time_line",
    "sevenbot_web::words::program",
    // Movements, recordings and files.
    "sevenbot::approach",
    "sevenbot::cartesian::line",
    "sevenbot::cartesian::nearest",
    "sevenbot::cartesian::refusal",
    "sevenbot::cartesian::target",
    "sevenbot::movement_run",
    "sevenbot::playback",
    "sevenbot::recording",
    "sevenbot_web::app::files",
    "sevenbot_web::app::kept_recording",
    "sevenbot_web::app::recording",
    "sevenbot_web::movement",
    "sevenbot_web::park",
    "sevenbot_web::recorder",
    // Things on the table, and drags and clicks in the picture.
    "arm_sim::world::moving",
    "arm_sim::world::solid",
    "kinematics::inverse",
    "kinematics::nearest",
    "sevenbot_web::scene::arm::Arm::pick",
    "sevenbot_web::arm_state::breach_on_way",
    "sevenbot_web::scene::drag",
    "sevenbot_web::scene::pointer",
    // A serial line that the user chooses, and texts.
    "Fault as core::str::traits::FromStr>",
    "Item as core::fmt::Display>",
    "Scene as core::fmt::Display>",
    "Scene as core::str::traits::FromStr>",
    "arm_sim::action",
    "arm_sim::faults::ArmFault",
    "arm_sim::faults::obstacle",
    "sevenbot::map",
    "sevenbot::register_values",
    "sevenbot::register_text",
    "sevenbot::traffic_text",
    "sevenbot_web::source::serial",
    // Rare cases of mathematics and of parsing numbers.
    "dec2flt::decimal_seq",
    "rem_pio2_large",
    "slice_error_fail",
];
/// The function of the page that loads the rest unless it is there.
const NEED_REST: &str = "need_rest";
/// The name by which the rest imports from the first part.
const FIRST: &str = "first";

/// The two parts of a module.
pub(super) struct Parts {
    pub(super) first: Vec<u8>,
    pub(super) rest: Vec<u8>,
}

/// Splits a module whose functions have names.
pub(super) fn split(module: &[u8]) -> TaskResult<Parts> {
    let mut first = parse(module)?;
    let is_later = later(&first);
    let is_entry = entries(&first, &is_later);
    let table = function_table(&first)?;
    let start = first.tables.get(table).initial;
    let mut rest = parse(module)?;
    make_rest(&mut rest, &is_later, &is_entry, start)?;
    replace_by_calls(&mut first, &is_entry, start)?;
    for import in rest.imports.iter() {
        export(&mut first, import)?;
    }
    passes::gc::run(&mut first);
    Ok(Parts { first: first.emit_wasm(), rest: rest.emit_wasm() })
}

fn parse(module: &[u8]) -> TaskResult<Module> {
    let mut config = ModuleConfig::new();
    Ok(config.generate_name_section(false).generate_producers_section(false).parse(module)?)
}

/// The functions of a module. The same function has the same place in each copy of the module.
fn functions(module: &Module) -> Vec<FunctionId> {
    module.funcs.iter().map(Function::id).collect()
}

fn function_table(module: &Module) -> TaskResult<TableId> {
    Ok(module.tables.main_function_table()?.ok_or("the module has no table of functions")?)
}

/// Which functions belong to the rest: those of [`LATER`], and those that the roots reach only through them or not at all.
fn later(module: &Module) -> Vec<bool> {
    let is_seed = |id: &FunctionId| {
        let function = module.funcs.get(*id);
        let name = function.name.as_deref().unwrap_or_default();
        // The first view calls the drop functions of types whose values it never sets.
        let is_drop = name.starts_with("core::ptr::drop_in_place");
        matches!(function.kind, FunctionKind::Local(_))
            && !is_drop
            && LATER.iter().any(|part| name.contains(part))
    };
    let mut reached = HashSet::new();
    let mut open: Vec<_> = roots(module);
    while let Some(id) = open.pop() {
        if !is_seed(&id) && reached.insert(id) {
            open.extend(calls(module, id));
        }
    }
    let is_local = |id: &FunctionId| matches!(module.funcs.get(*id).kind, FunctionKind::Local(_));
    functions(module).iter().map(|id| is_local(id) && !reached.contains(id)).collect()
}

/// The functions that are called from outside, or by their place in a table.
fn roots(module: &Module) -> Vec<FunctionId> {
    let exported = module.exports.iter().filter_map(|export| match export.item {
        ExportItem::Function(id) => Some(id),
        _ => None,
    });
    let in_tables = module.elements.iter().flat_map(|element| match &element.items {
        ElementItems::Functions(ids) => ids.as_slice(),
        ElementItems::Expressions(..) => &[],
    });
    exported.chain(in_tables.copied()).chain(module.start).collect()
}

/// The functions that a function names in its code.
fn calls(module: &Module, id: FunctionId) -> Vec<FunctionId> {
    struct Calls(Vec<FunctionId>);
    impl Visitor<'_> for Calls {
        fn visit_function_id(&mut self, id: &FunctionId) {
            self.0.push(*id);
        }
    }
    let mut calls = Calls(Vec::new());
    if let FunctionKind::Local(function) = &module.funcs.get(id).kind {
        dfs_in_order(&mut calls, function, function.entry_block());
    }
    calls.0
}

/// Which functions of the rest are called from the first part, from outside or by their place in a table.
fn entries(module: &Module, is_later: &[bool]) -> Vec<bool> {
    let functions = functions(module);
    let of_first = functions.iter().zip(is_later).filter(|(_, is_later)| !**is_later);
    let called: HashSet<_> = of_first.flat_map(|(id, _)| calls(module, *id)).chain(roots(module)).collect();
    functions.iter().zip(is_later).map(|(id, is_later)| *is_later && called.contains(id)).collect()
}

/// The functions of a module for which `is_chosen` is true.
fn chosen(module: &Module, is_chosen: &[bool]) -> Vec<FunctionId> {
    let functions = functions(module).into_iter().zip(is_chosen);
    functions.filter_map(|(id, is_chosen)| is_chosen.then_some(id)).collect()
}

/// Replaces each entry by a function that calls the function at its place in the table, where the rest enters it. The places
/// begin at `start`.
fn replace_by_calls(module: &mut Module, is_entry: &[bool], start: u64) -> TaskResult {
    let need_rest = module.exports.get_func(NEED_REST)?;
    let table = function_table(module)?;
    let entries = chosen(module, is_entry);
    for (slot, id) in (start..).zip(entries.iter().copied()) {
        let ty = module.funcs.get(id).ty();
        let (parameters, results) = module.types.params_results(ty);
        let (parameters, results) = (parameters.to_vec(), results.to_vec());
        let arguments: Vec<_> = parameters.iter().map(|ty| module.locals.add(*ty)).collect();
        let mut function = FunctionBuilder::new(&mut module.types, &parameters, &results);
        let mut body = function.func_body();
        body.call(need_rest);
        for argument in &arguments {
            body.local_get(*argument);
        }
        body.i32_const(i32::try_from(slot)?).call_indirect(ty, table);
        module.funcs.get_mut(id).kind = FunctionKind::Local(function.local_func(arguments));
    }
    add_slots(module.tables.get_mut(table), entries.len())
}

/// Makes room for this many entries.
fn add_slots(table: &mut Table, entries: usize) -> TaskResult {
    let slots = u64::try_from(entries)?;
    table.initial += slots;
    table.maximum = table.maximum.map(|maximum| maximum + slots);
    Ok(())
}

/// Leaves the functions of the rest in a copy of the module. Everything else that they use becomes an import from the first part.
fn make_rest(module: &mut Module, is_later: &[bool], is_entry: &[bool], start: u64) -> TaskResult {
    let table = function_table(module)?;
    let entries = chosen(module, is_entry);
    let is_first: Vec<_> = is_later.iter().map(|is_later| !is_later).collect();
    clear(module);
    for id in chosen(module, &is_first) {
        let ty = module.funcs.get(id).ty();
        let import = module.imports.add(FIRST, &format!("f{}", id.index()), id);
        module.funcs.get_mut(id).kind = FunctionKind::Import(ImportedFunction { import, ty });
    }
    import_state(module);
    let offset = ConstExpr::Value(Value::I32(i32::try_from(start)?));
    let kind = ElementKind::Active { table, offset };
    let table = module.tables.get_mut(table);
    add_slots(table, entries.len())?;
    table.elem_segments.insert(module.elements.add(kind, ElementItems::Functions(entries)));
    passes::gc::run(module);
    Ok(())
}

/// Removes the start function, the exports, the imports, the data and the elements, which only the first part keeps.
fn clear(module: &mut Module) {
    module.start = None;
    let exports: Vec<_> = module.exports.iter().map(Export::id).collect();
    exports.into_iter().for_each(|id| module.exports.delete(id));
    let imports: Vec<_> = module.imports.iter().map(Import::id).collect();
    imports.into_iter().for_each(|id| module.imports.delete(id));
    let data: Vec<_> = module.data.iter().map(Data::id).collect();
    data.into_iter().for_each(|id| module.data.delete(id));
    let elements: Vec<_> = module.elements.iter().map(Element::id).collect();
    elements.into_iter().for_each(|id| module.elements.delete(id));
    module.memories.iter_mut().for_each(|memory| memory.data_segments.clear());
    module.tables.iter_mut().for_each(|table| table.elem_segments.clear());
}

/// Makes the memory, the tables and the globals imports.
fn import_state(module: &mut Module) {
    for memory in module.memories.iter_mut() {
        let id = memory.id();
        memory.import = Some(module.imports.add(FIRST, &format!("m{}", id.index()), id));
    }
    for table in module.tables.iter_mut() {
        let id = table.id();
        table.import = Some(module.imports.add(FIRST, &format!("t{}", id.index()), id));
    }
    let globals: Vec<_> = module.globals.iter().map(Global::id).collect();
    for id in globals {
        let import = module.imports.add(FIRST, &format!("g{}", id.index()), id);
        module.globals.get_mut(id).kind = GlobalKind::Import(import);
    }
}

/// Exports the item that the rest imports, under the same name.
fn export(first: &mut Module, import: &Import) -> TaskResult {
    let item: Option<ExportItem> = match import.kind {
        ImportKind::Function(id) => first.funcs.iter().nth(id.index()).map(|item| item.id().into()),
        ImportKind::Table(id) => first.tables.iter().nth(id.index()).map(|item| item.id().into()),
        ImportKind::Memory(id) => first.memories.iter().nth(id.index()).map(|item| item.id().into()),
        ImportKind::Global(id) => first.globals.iter().nth(id.index()).map(|item| item.id().into()),
        ImportKind::Tag(_) => None,
    };
    let item = item.ok_or("the rest imports what the first part does not have")?;
    first.exports.add(&import.name, item);
    Ok(())
}
