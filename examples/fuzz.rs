//! Fuzzes decoders, drivers and importers on stable Rust: seeded, for a limited time, without further tools.
//!
//! `cargo run --release --example fuzz -- [--seconds N] [--seed N] [--corpus DIR] [TARGET]...`
//!
//! It mutates inputs, and keeps those with a new outcome. An input that breaks a promise of its target is written to
//! `out/fuzz/` and named, and the run fails. `--corpus DIR` adds the inputs in `DIR/TARGET`, and stores kept inputs
//! there.
//!
//! `cargo +nightly fuzz run TARGET` uses the same folders in `fuzz/corpus`. It is guided by coverage and finds more.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Parser;

#[allow(unreachable_pub)]
#[path = "../fuzz/bodies.rs"]
mod bodies;

use bodies::{TARGETS, Target};

/// Longest input, bytes.
const INPUT_LIMIT: usize = 16 << 10;

/// Largest number of inputs kept per target.
const CORPUS_LIMIT: usize = 4000;

/// Duration from which an input is reported as slow.
const SLOW: Duration = Duration::from_secs(2);

/// Fuzzes decoders, drivers and importers.
#[derive(Parser)]
struct Args {
    /// Time for each target, s.
    #[arg(long, default_value_t = 10)]
    seconds: u64,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of inputs, with one subfolder per target.
    #[arg(long)]
    corpus: Option<PathBuf>,
    /// Targets; all by default.
    targets: Vec<String>,
}

/// Random numbers by the generator xorshift64*.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// Random number below `end`; 0 if `end` is 0.
    fn below(&mut self, end: usize) -> usize {
        ((self.next() >> 33) as usize) % end.max(1)
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let unknown = args.targets.iter().find(|name| TARGETS.iter().all(|target| target.name != **name));
    if let Some(name) = unknown {
        bail!("no target `{name}`; there are {}", TARGETS.map(|target| target.name).join(", "));
    }
    std::panic::set_hook(Box::new(|_| ()));
    let mut failures = 0;
    for target in TARGETS {
        if args.targets.is_empty() || args.targets.iter().any(|name| name == target.name) {
            failures += fuzz(&target, &args)?;
        }
    }
    if failures > 0 {
        bail!("{failures} inputs break a promise; they are in out/fuzz");
    }
    Ok(())
}

/// Fuzzes one target. Returns the number of inputs that broke a promise.
fn fuzz(target: &Target, args: &Args) -> anyhow::Result<usize> {
    let folder = args.corpus.as_ref().map(|dir| dir.join(target.name));
    let mut corpus = (target.seeds)();
    if let Some(folder) = &folder {
        corpus.extend(read(folder)?);
    }
    let mut random = Random(args.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let (mut seen, mut failed, mut kept) = (HashSet::new(), HashSet::new(), 0_usize);
    let (mut runs, mut slowest) = (0_u64, Duration::ZERO);
    let started = Instant::now();
    let ends = Duration::from_secs(args.seconds);
    let mut fresh = corpus.len();
    while started.elapsed() < ends || fresh > 0 {
        // Inputs that exist already run first, unchanged.
        let input = if fresh > 0 {
            fresh -= 1;
            corpus[fresh].clone()
        } else {
            mutated(&corpus, &mut random)
        };
        let began = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (target.body)(&input)));
        let took = began.elapsed();
        runs += 1;
        if took > slowest {
            slowest = took;
            if took > SLOW {
                println!(
                    "{}: an input takes {:.1} s: {}",
                    target.name,
                    took.as_secs_f64(),
                    write(target, &input)?.display()
                );
            }
        }
        match outcome {
            Ok(signature) => {
                if seen.insert(signature) && corpus.len() < CORPUS_LIMIT {
                    if let Some(folder) = &folder {
                        save(folder, &input)?;
                    }
                    corpus.push(input);
                    kept += 1;
                }
            }
            Err(panic) => {
                let text = panic
                    .downcast_ref::<String>()
                    .cloned()
                    .or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()))
                    .unwrap_or_default();
                let kind: String = text.chars().filter(|c| !c.is_ascii_digit()).take(60).collect();
                if failed.insert(kind) {
                    println!("{}: {text}\n  {}", target.name, write(target, &input)?.display());
                }
            }
        }
    }
    println!(
        "{}: {runs} inputs in {:.0} s, {kept} kept, slowest {:.1} ms, {} failures",
        target.name,
        started.elapsed().as_secs_f64(),
        slowest.as_secs_f64() * 1e3,
        failed.len()
    );
    Ok(failed.len())
}

fn mutated(corpus: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    const NUMBERS: [u32; 10] = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFF_FFFF, u32::MAX];
    let mut input = corpus.get(random.below(corpus.len())).cloned().unwrap_or_default();
    for _ in 0..=random.below(6) {
        let at = random.below(input.len());
        let end = (at + 1 + random.below(24)).min(input.len());
        match random.below(9) {
            0 if !input.is_empty() => input[at] ^= 1 << random.below(8),
            1 if !input.is_empty() => input[at] = random.next() as u8,
            2 => drop(input.drain(at.min(end)..end)),
            3 => {
                let bytes: Vec<u8> = (0..=random.below(16)).map(|_| random.next() as u8).collect();
                input.splice(at..at, bytes);
            }
            4 => {
                let piece = input[at.min(end)..end].to_vec();
                let to = random.below(input.len() + 1);
                input.splice(to..to, piece);
            }
            5 => {
                let number = NUMBERS[random.below(NUMBERS.len())];
                let bytes = if random.below(2) == 0 { number.to_le_bytes() } else { number.to_be_bytes() };
                input.iter_mut().skip(at).zip(&bytes[..1 << random.below(3)]).for_each(|(slot, byte)| *slot = *byte);
            }
            6 => {
                let other = &corpus[random.below(corpus.len())];
                let from = random.below(other.len());
                input.truncate(at);
                input.extend(&other[from..]);
            }
            7 => input.truncate(at + 1),
            _ => {
                let digits = b"0123456789-+.eE,\"[]{}:";
                if !input.is_empty() {
                    input[at] = digits[random.below(digits.len())];
                }
            }
        }
    }
    input.truncate(INPUT_LIMIT);
    input
}

fn read(folder: &Path) -> anyhow::Result<Vec<Vec<u8>>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    entries.map(|entry| Ok(std::fs::read(entry?.path())?)).collect()
}

/// Writes `input` into `folder` under a name derived from its content.
fn save(folder: &Path, input: &[u8]) -> anyhow::Result<PathBuf> {
    use std::hash::{DefaultHasher, Hash, Hasher};
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let mut hasher = DefaultHasher::new();
    input.hash(&mut hasher);
    let path = folder.join(format!("{:016x}", hasher.finish()));
    std::fs::write(&path, input).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

fn write(target: &Target, input: &[u8]) -> anyhow::Result<PathBuf> {
    save(&Path::new("out/fuzz").join(target.name), input)
}
