//! Variables of macros: local ones, common ones, and those with a name.

use std::collections::BTreeMap;

/// Most variables that have a value.
const VARIABLES_MAX: usize = 1 << 16;
/// Local variables, #1 to this one.
const LOCALS: u32 = 33;
/// The last common variable; what follows is of the machine.
const COMMON_LAST: u32 = 999;

/// What stands behind the mark of a variable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum VariableName {
    /// `#101`
    Number(u32),
    /// `#<width>`, in capital letters; global ones begin with an underscore.
    Named(Vec<u8>),
}

/// Variables of one call.
#[derive(Clone, Debug, Default)]
pub(super) struct LocalVariables {
    numbers: BTreeMap<u32, f64>,
    names: BTreeMap<Vec<u8>, f64>,
}

impl LocalVariables {
    /// Those that a call passes.
    pub fn of(numbers: BTreeMap<u32, f64>) -> LocalVariables {
        LocalVariables { numbers, names: BTreeMap::new() }
    }
}

/// All variables that can be reached.
#[derive(Debug)]
pub(super) struct MacroVariables {
    /// Those of calls within each other; the last ones count.
    locals: Vec<LocalVariables>,
    common: LocalVariables,
    count: usize,
}

impl MacroVariables {
    pub fn new() -> MacroVariables {
        MacroVariables {
            locals: vec![LocalVariables::default()],
            common: LocalVariables::default(),
            count: 0,
        }
    }

    /// A call with variables of its own.
    pub fn begin(&mut self, locals: LocalVariables) {
        self.locals.push(locals);
    }

    /// The end of the innermost one.
    pub fn end(&mut self) {
        if self.locals.len() > 1 {
            self.locals.pop();
        }
    }

    fn scope(&mut self, is_common: bool) -> &mut LocalVariables {
        match self.locals.last_mut() {
            Some(locals) if !is_common => locals,
            _ => &mut self.common,
        }
    }

    /// The value of a variable, or `None` of an empty one.
    ///
    /// # Errors
    /// If nothing can be known of it, with the reason.
    pub fn get(&self, name: &VariableName) -> Result<Option<f64>, String> {
        let locals = self.locals.last().unwrap_or(&self.common);
        let found = match name {
            VariableName::Number(0) => return Ok(None),
            VariableName::Number(number @ 1..=LOCALS) => return Ok(locals.numbers.get(number).copied()),
            VariableName::Number(number @ ..=COMMON_LAST) => self.common.numbers.get(number),
            VariableName::Number(number) => return Err(of_machine(*number)),
            VariableName::Named(name) if name.first() == Some(&b'_') => self.common.names.get(name),
            VariableName::Named(name) => locals.names.get(name),
        };
        match found {
            Some(value) => Ok(Some(*value)),
            None => Err(format!("reads the variable {}, which the program has not set", shown(name))),
        }
    }

    /// Gives a variable a value, or none.
    ///
    /// # Errors
    /// If it cannot be set, with the reason.
    pub fn set(&mut self, name: VariableName, value: Option<f64>) -> Result<(), String> {
        if self.count == VARIABLES_MAX {
            return Err("sets more variables than can be followed".to_owned());
        }
        self.count += 1;
        match name {
            VariableName::Number(0) => return Err("sets #0, which is always empty".to_owned()),
            VariableName::Number(number) if number > COMMON_LAST => return Err(of_machine(number)),
            VariableName::Number(number) => {
                let numbers = &mut self.scope(number > LOCALS).numbers;
                let before = match value {
                    Some(value) => numbers.insert(number, value),
                    None => numbers.remove(&number),
                };
                self.count -= usize::from(before.is_some() || value.is_none());
            }
            VariableName::Named(name) => {
                let is_common = name.first() == Some(&b'_');
                let names = &mut self.scope(is_common).names;
                let before = match value {
                    Some(value) => names.insert(name, value),
                    None => names.remove(&name),
                };
                self.count -= usize::from(before.is_some() || value.is_none());
            }
        }
        Ok(())
    }
}

fn of_machine(number: u32) -> String {
    format!("takes #{number}, a variable of the machine, which no program tells")
}

fn shown(name: &VariableName) -> String {
    match name {
        VariableName::Number(number) => format!("#{number}"),
        VariableName::Named(name) => format!("#<{}>", String::from_utf8_lossy(name)),
    }
}
