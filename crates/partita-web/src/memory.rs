//! Texts between JavaScript and the core: JavaScript writes a request into memory that the core provides, and reads the
//! answer from where the core has put it.
#![allow(unsafe_code, reason = "the functions are called from outside, with places in memory")]

use std::cell::RefCell;

thread_local! {
    /// The request, then the answer: a module has one thread and answers one request at a time.
    static TEXT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Memory for a request of so many bytes.
#[no_mangle]
pub extern "C" fn request(bytes: usize) -> *mut u8 {
    TEXT.with_borrow_mut(|text| {
        text.clear();
        text.resize(bytes, 0);
        text.as_mut_ptr()
    })
}

/// Answer the request that was written there, and return the number of bytes of the answer.
#[no_mangle]
pub extern "C" fn answer() -> usize {
    TEXT.with_borrow_mut(|text| {
        *text = crate::answers::answer(&String::from_utf8_lossy(text)).into_bytes();
        text.len()
    })
}

/// Where the answer is.
#[no_mangle]
pub extern "C" fn answered() -> *const u8 {
    TEXT.with_borrow(|text| text.as_ptr())
}
