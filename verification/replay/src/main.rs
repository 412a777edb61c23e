//! `cargo xtask replays`: the same random sessions natively and in a WebAssembly module, each replayed several times.

use std::error::Error;
use std::path::PathBuf;

use clap::Parser;
use replay::{equal_replays, session_checksum};
use wasmi::{Engine, Linker, Module, Store, TypedFunc};

/// Records random sessions natively and in a WebAssembly module, compares them, and replays them.
#[derive(Debug, Parser)]
struct ReplayOptions {
    /// The module: this package, built for wasm32-unknown-unknown
    #[arg(long)]
    module: PathBuf,
    /// Number of sessions, each of about two seconds of virtual time
    #[arg(long, default_value_t = 1_000)]
    sessions: u64,
    /// How often each session is replayed, natively and in the module
    #[arg(long, default_value_t = 10)]
    times: u32,
    /// Seed of the first session
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The module, interpreted.
struct WasmModule {
    store: Store<()>,
    session_checksum: TypedFunc<u64, u64>,
    equal_replays: TypedFunc<(u64, u32), u32>,
}

impl WasmModule {
    fn load(path: &PathBuf) -> Result<Self, Box<dyn Error>> {
        let engine = Engine::default();
        let module = Module::new(&engine, std::fs::read(path)?)?;
        let mut store = Store::new(&engine, ());
        let instance = Linker::new(&engine).instantiate_and_start(&mut store, &module)?;
        Ok(Self {
            session_checksum: instance.get_typed_func(&store, "session_checksum")?,
            equal_replays: instance.get_typed_func(&store, "equal_replays")?,
            store,
        })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let ReplayOptions { module, sessions, times, seed } = ReplayOptions::parse();
    let mut wasm = WasmModule::load(&module)?;
    for seed in seed..seed + sessions {
        let checksum = wasm.session_checksum.call(&mut wasm.store, seed)?;
        if checksum != session_checksum(seed) {
            return Err(format!("the session of seed {seed} differs in the module").into());
        }
        let equal = [equal_replays(seed, times), wasm.equal_replays.call(&mut wasm.store, (seed, times))?];
        if equal != [times; 2] {
            return Err(format!("seed {seed}: {equal:?} of {times} replays are equal").into());
        }
    }
    let replays = sessions * u64::from(times);
    println!(
        "{sessions} sessions are the same natively and in the module; {replays} replays in each: all equal"
    );
    Ok(())
}
