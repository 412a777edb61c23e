use super::*;
use crate::python;

/// Parses a workspace with these top blocks, and with the variables x and y.
fn program(blocks: &str) -> Result<Program, ProgramError> {
    Program::parse(&format!(
        r#"{{"blocks": {{"blocks": [{blocks}]}}, "variables": [{{"name": "x", "id": "vx"}}, {{"name": "y", "id": "vy"}}]}}"#
    ))
}

/// The start block with these blocks below it, in the form that `stack` takes.
fn start(blocks: &[String]) -> String {
    format!(r#"{{"type": "arm_start", "id": "start", "next": {}}}"#, stack(blocks))
}

/// A connection to these blocks, one below the other. Each is given without its last brace, so that the next one can be added.
fn stack(blocks: &[String]) -> String {
    let below = |below: String, block: &String| format!(r#"{{"block": {block}, "next": {below}}}}}"#);
    blocks.iter().rev().fold("null".to_owned(), below)
}

fn block(kind: &str, rest: &str) -> String {
    format!(r#"{{"type": "{kind}", "id": "{kind}"{}{rest}"#, if rest.is_empty() { "" } else { ", " })
}

fn number(number: f64) -> String {
    format!(r#"{{"block": {{"type": "math_number", "id": "n", "fields": {{"NUM": {number}}}}}}}"#)
}

fn variable(id: &str) -> String {
    format!(r#"{{"block": {{"type": "variables_get", "id": "get", "fields": {{"VAR": {{"id": "{id}"}}}}}}}}"#)
}

fn calculate(operation: &str, one: &str, other: &str) -> String {
    format!(
        r#"{{"block": {{"type": "math_arithmetic", "id": "c", "fields": {{"OP": "{operation}"}}, "inputs": {{"A": {one}, "B": {other}}}}}}}"#
    )
}

fn set(id: &str, value: &str) -> String {
    block(
        "variables_set",
        &format!(r#""fields": {{"VAR": {{"id": "{id}"}}}}, "inputs": {{"VALUE": {value}}}"#),
    )
}

fn wait(seconds: &str) -> String {
    block("arm_wait", &format!(r#""inputs": {{"SECONDS": {seconds}}}"#))
}

fn repeat(times: &str, body: &[String]) -> String {
    block("controls_repeat_ext", &format!(r#""inputs": {{"TIMES": {times}, "DO": {}}}"#, stack(body)))
}

fn flow(kind: &str) -> String {
    block("controls_flow_statements", &format!(r#""fields": {{"FLOW": "{kind}"}}"#))
}

/// Runs a program to its end. Returns the seconds of all waits.
fn waits(blocks: &str) -> Result<Vec<f64>, ProgramError> {
    let mut run = Interpreter::new(&program(blocks)?);
    let mut waits = Vec::new();
    for _ in 0..100_000 {
        match run.advance()? {
            ProgramEvent::Begin(_) => {}
            ProgramEvent::Command(ProgramCommand::Wait(time)) => waits.push(time.as_secs_f64()),
            ProgramEvent::Over => return Ok(waits),
            other => panic!("{other:?}"),
        }
    }
    panic!("no end")
}

#[test]
fn loops_variables_and_arithmetic_have_their_values() {
    let add = calculate("ADD", &variable("vx"), &number(1.0));
    let body = [set("vx", &add), wait(&variable("vx"))];
    assert_eq!(waits(&start(&[repeat(&number(3.9), &body)])), Ok(vec![1.0, 2.0, 3.0]));
    assert_eq!(waits(&start(&[repeat(&number(-1.0), &body), wait(&number(7.0))])), Ok(vec![7.0]));
    let left = [set("vx", &add), wait(&variable("vx")), flow("BREAK"), wait(&number(9.0))];
    assert_eq!(waits(&start(&[repeat(&number(2.0), &[repeat(&number(5.0), &left)])])), Ok(vec![1.0, 2.0]));
    let skipped = [wait(&number(1.0)), flow("CONTINUE"), wait(&number(9.0))];
    assert_eq!(waits(&start(&[repeat(&number(2.0), &skipped)])), Ok(vec![1.0, 1.0]));
}

fn function(kind: &str, body: &[String], result: &str) -> String {
    format!(
        r#"{{"type": "{kind}", "id": "f", "fields": {{"NAME": "f"}}, "extraState": {{"params": [{{"name": "n", "id": "vy"}}]}},
           "inputs": {{"STACK": {}{result}}}}}"#,
        stack(body)
    )
}

fn call(argument: &str) -> String {
    format!(
        r#"{{"block": {{"type": "procedures_callreturn", "id": "call", "extraState": {{"name": "f", "params": ["n"]}},
            "inputs": {{"ARG0": {argument}}}}}}}"#
    )
}

/// f(n) = 1 if n <= 1, or else n * f(n - 1).
fn factorial() -> String {
    let condition = format!(
        r#"{{"block": {{"type": "logic_compare", "id": "l", "fields": {{"OP": "LTE"}}, "inputs": {{"A": {}, "B": {}}}}}}}"#,
        variable("vy"),
        number(1.0)
    );
    let end = block(
        "procedures_ifreturn",
        &format!(r#""inputs": {{"CONDITION": {condition}, "VALUE": {}}}"#, number(1.0)),
    );
    let less = call(&calculate("MINUS", &variable("vy"), &number(1.0)));
    let result = format!(r#", "RETURN": {}"#, calculate("MULTIPLY", &variable("vy"), &less));
    function("procedures_defreturn", &[end], &result)
}

#[test]
fn a_function_calls_itself_up_to_a_limit() {
    let blocks = |n: f64| format!("{}, {}", factorial(), start(&[wait(&call(&number(n)))]));
    assert_eq!(waits(&blocks(5.0)), Ok(vec![120.0]));
    let endless = format!("{}, {}", factorial(), start(&[wait(&call(&number(1e6)))]));
    let error = waits(&endless).expect_err("no end");
    assert_eq!((error.fault, error.block.as_deref()), (ProgramFault::TooManyCalls, Some("call")));
    let python = python(&program(&blocks(5.0)).expect("a program"));
    let function = "\n\n\ndef f(y):\n    if y <= 1:\n        return 1\n    return y * f(y - 1)\n\n\nwith";
    assert!(python.contains(function) && python.contains("    arm.sleep(f(5))\n"), "{python}");
}

#[test]
fn each_round_of_an_endless_loop_is_an_event() {
    let condition = r#"{"block": {"type": "logic_boolean", "id": "t", "fields": {"BOOL": "TRUE"}}}"#;
    let endless = block(
        "controls_whileUntil",
        &format!(r#""fields": {{"MODE": "WHILE"}}, "inputs": {{"BOOL": {condition}}}"#),
    );
    let mut run = Interpreter::new(&program(&start(&[endless])).expect("a program"));
    for _ in 0..1_000 {
        assert_eq!(run.advance(), Ok(ProgramEvent::Begin("controls_whileUntil".into())));
    }
}

#[test]
fn what_is_no_program_names_its_block() {
    let fault = |blocks: &str| {
        let error = program(blocks).expect_err("an error");
        (error.block.as_deref().map(str::to_owned), error.fault)
    };
    let at = |block: &str, fault| (Some(block.to_owned()), fault);
    assert_eq!(fault(""), (None, ProgramFault::NoStart));
    let two = format!("{}, {}", start(&[]), start(&[]));
    assert_eq!(fault(&two), at("start", ProgramFault::SeveralStarts));
    let empty = start(&[block("arm_wait", "")]);
    assert_eq!(fault(&empty), at("arm_wait", ProgramFault::EmptyInput("SECONDS".to_owned())));
    let other = start(&[block("text_print", "")]);
    assert_eq!(fault(&other), at("text_print", ProgramFault::UnknownBlock("text_print".to_owned())));
    let field = start(&[block("arm_grip", r#""fields": {"STATE": "HALF"}"#)]);
    assert_eq!(fault(&field), at("arm_grip", ProgramFault::BadField("STATE".to_owned())));
    let loose = start(&[flow("BREAK")]);
    assert_eq!(fault(&loose), at("controls_flow_statements", ProgramFault::NotInLoop));
    let unknown = start(&[wait(&call(&number(1.0)))]);
    assert_eq!(fault(&unknown), at("call", ProgramFault::UnknownFunction("f".to_owned())));
    assert!(matches!(Program::parse("hello").expect_err("no JSON").fault, ProgramFault::NotAWorkspace(_)));
    let large = format!("\"{}\"", " ".repeat(500_000));
    assert_eq!(Program::parse(&large).expect_err("too large").fault, ProgramFault::TooLarge);
}

#[test]
fn a_long_stack_is_parsed_and_a_deep_nest_is_refused() {
    let long = start(&vec![block("arm_vacuum", r#""fields": {"STATE": "ON"}"#); 800]);
    assert_eq!(program(&long).expect("a program").body.len(), 800);
    let deep = (0..1_000).fold(wait(&number(1.0)), |inner, _| repeat(&number(1.0), &[inner]));
    assert_eq!(program(&start(&[deep])).expect_err("too deep").fault, ProgramFault::TooDeep);
    let brackets = format!("{}{}", "[".repeat(100_000), "]".repeat(50_000));
    assert!(Program::parse(&brackets).is_err());
}

#[test]
fn a_number_out_of_range_is_told_with_its_block() {
    let error = waits(&start(&[wait(&number(-1.0))])).expect_err("a negative time");
    assert_eq!(error.to_string(), "-1 is out of range: use 0 to 86400 s");
    let zero =
        waits(&start(&[wait(&calculate("DIVIDE", &number(1.0), &number(0.0)))])).expect_err("no number");
    assert_eq!((zero.fault, zero.block.as_deref()), (ProgramFault::NoNumber, Some("c")));
}

#[test]
fn python_has_brackets_where_they_change_the_value() {
    let text = |expression: &str| {
        let python = python(&program(&start(&[wait(expression)])).expect("a program"));
        let call = python.split("arm.sleep(").nth(1).and_then(|rest| rest.strip_suffix(")\n"));
        call.expect("a call").to_owned()
    };
    let x = variable("vx");
    assert_eq!(text(&calculate("MINUS", &x, &calculate("MINUS", &x, &x))), "x - (x - x)");
    assert_eq!(text(&calculate("MINUS", &calculate("MINUS", &x, &x), &x)), "x - x - x");
    assert_eq!(text(&calculate("POWER", &number(-2.0), &number(-0.5))), "(-2) ** -0.5");
    assert_eq!(text(&calculate("MULTIPLY", &calculate("ADD", &x, &x), &x)), "(x + x) * x");
}
