//! The debugger's files and console (Arm, "Semihosting for AArch32 and AArch64"), without formatting: what prints
//! a float in decimal would weigh more than the estimator.

use core::arch::asm;
use core::mem::MaybeUninit;

const SYS_OPEN: usize = 0x01;
const SYS_WRITE0: usize = 0x04;
const SYS_READ: usize = 0x06;
const SYS_EXIT: usize = 0x18;
const APPLICATION_EXIT: usize = 0x20026;
const READ_BINARY: usize = 1;

/// # Safety
/// `parameter` is what the operation asks for.
unsafe fn call(operation: usize, parameter: usize) -> usize {
    let result;
    // SAFETY: the debugger keeps all registers but r0.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => result, in("r1") parameter) };
    result
}

/// A file of the host, read in order.
pub struct File(usize);

impl File {
    /// `name` ends with a zero.
    pub fn open(name: &'static [u8]) -> Self {
        let block = [name.as_ptr() as usize, READ_BINARY, name.len() - 1];
        // SAFETY: name, mode and length, as the operation asks.
        Self(unsafe { call(SYS_OPEN, block.as_ptr() as usize) })
    }

    /// The next numbers of the file, in the machine's own bytes; none at its end.
    pub fn read<const K: usize>(&self) -> Option<[f32; K]> {
        let mut values = MaybeUninit::<[f32; K]>::uninit();
        let block = [self.0, values.as_mut_ptr() as usize, 4 * K];
        // SAFETY: handle, buffer and its length, as the operation asks; it says how many bytes it did not fill.
        unsafe { (call(SYS_READ, block.as_ptr() as usize) == 0).then(|| values.assume_init()) }
    }
}

/// Prints a line: a word and numbers in hexadecimal.
pub fn print(word: &'static [u8], numbers: &[u32]) {
    put(word);
    for number in numbers {
        put(b" \0");
        for digit in (0..8).rev() {
            let nibble = (number >> (4 * digit)) as u8 & 15;
            let letter = if nibble < 10 { b'0' + nibble } else { b'a' - 10 + nibble };
            put(&[letter, 0]);
        }
    }
    put(b"\n\0");
}

fn put(text: &[u8]) {
    // SAFETY: the text ends with a zero.
    unsafe { call(SYS_WRITE0, text.as_ptr() as usize) };
}

/// Ends the emulator.
pub fn exit() -> ! {
    loop {
        // SAFETY: the reason, as the operation asks.
        unsafe { call(SYS_EXIT, APPLICATION_EXIT) };
    }
}
