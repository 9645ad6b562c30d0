/*
 * trefoil_process.h: libtrefoil, for programs with a `main` of their own. Generated; do not edit.
 *
 * A node of the ring, started by the launcher as `exec` of that node:
 *
 *     trefoil_join, trefoil_setup, trefoil_memory
 *     then for each sample trefoil_next, trefoil_remember, trefoil_send
 *     at last trefoil_leave
 *
 * A flight in this process, whose caller is one of its nodes:
 *
 *     trefoil_flight_open, then trefoil_flight_next and trefoil_flight_answer for each sample
 *     at last trefoil_flight_record, trefoil_flight_close
 *
 * Inputs and answers have the types of trefoil.h.
 */

#pragma once

#include <stddef.h>
#include <stdint.h>
#include "trefoil.h"

// Flight whose caller is one of its nodes.
typedef struct TrefoilFlight TrefoilFlight;

// Process of a node that has joined a run.
typedef struct TrefoilSession TrefoilSession;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the number of the interface of this library: `TREFOIL_ABI` of its headers.
uint32_t trefoil_abi(void);

// Returns the size of the input of `node`, for instance `sizeof(TrefoilAttitudeInput)`; 0 if there is no such node.
size_t trefoil_input_bytes(const char *node);

// Returns the size of the answer of `node`, for instance `sizeof(TrefoilAttitudeAnswer)`; 0 if there is no such node.
size_t trefoil_answer_bytes(const char *node);

// Joins the run that the launcher has started this program for, as `node`: `guidance`, `attitude-mpc` or `mixer`. Give
// the arguments of `main`: those of the launcher are found among them. On an error writes its reason to `error`, of
// `error_bytes`, and returns NULL. A session is used from one thread.
struct TrefoilSession *trefoil_join(const char *node,
                                    int32_t argc,
                                    const char *const *argv,
                                    char *error,
                                    size_t error_bytes);

// Returns vehicle and settings; valid until `trefoil_leave`.
const TrefoilSetup *trefoil_setup(const struct TrefoilSession *session);

// Copies the memory that the process before this one left by `trefoil_remember` to `memory`, of `bytes`, and returns
// its size: 0 = none, begin cold. Call it before the first `trefoil_next`; without this call a program begins cold.
// A negative result is an error.
int32_t trefoil_memory(struct TrefoilSession *session, void *memory, size_t bytes);

// Waits for the next sample to answer, and writes it to `input`, of `bytes`: the size of the node's type in
// `trefoil.h`. The first call says that this process is ready: allocate and load everything before it.
//
// Returns 1: answer by `trefoil_send`. 0: the run is over, or another process has taken over; leave. Below 0: an
// error; end the process with this number as its exit code, without the sign.
int32_t trefoil_next(struct TrefoilSession *session, void *input, size_t bytes);

// Gives `memory`, of at most `TREFOIL_MEMORY_BYTES`, to the process that continues after this one. Call it before
// `trefoil_send`, whose answer it belongs to. Returns 0, or below 0 on an error.
int32_t trefoil_remember(struct TrefoilSession *session, const void *memory, size_t bytes);

// Sends `answer`, of `bytes`: the size of the node's type in `trefoil.h`. Returns 0, or below 0 as `trefoil_next`.
int32_t trefoil_send(struct TrefoilSession *session, const void *answer, size_t bytes);

// Returns the reason of the last error; valid until the next call.
const char *trefoil_error(const struct TrefoilSession *session);

// Leaves the run, and frees the session. Does nothing if `session` is NULL, or in a child process made by `fork`: the
// session belongs to the process that joined.
void trefoil_leave(struct TrefoilSession *session);

// Runs this process as the plant of the run that the launcher has started it for, with the vehicle that `functions`
// create: as in a library, `step` reads a `TrefoilPlantInput` and writes a `TrefoilPlantAnswer`. Give the arguments of
// `main`: those of the launcher are found among them.
//
// Returns 0 after the run. Below 0: an error, with its reason in `error`, of `error_bytes`; end the process with this
// number as its exit code, without the sign.
int32_t trefoil_plant_run(const TrefoilNode *functions,
                          int32_t argc,
                          const char *const *argv,
                          char *error,
                          size_t error_bytes);

// Opens a flight of the file `scenario`, or of the defaults if it is NULL, with `count` settings `KEY=VALUE` on top,
// as `trefoil fly --mode inprocess --set KEY=VALUE`. The caller is `node`: `guidance`, `attitude-mpc` or `mixer`. On
// an error writes its reason to `error`, of `error_bytes`, and returns NULL. A flight is used from one thread.
//
// Libraries of other nodes are loaded without a trial: one that crashes ends this process.
struct TrefoilFlight *trefoil_flight_open(const char *scenario,
                                          const char *const *settings,
                                          size_t count,
                                          const char *node,
                                          char *error,
                                          size_t error_bytes);

// Returns vehicle and settings; valid until `trefoil_flight_close`.
const TrefoilSetup *trefoil_flight_setup(const struct TrefoilFlight *flight);

// Flies to the next sample to answer, and writes it to `input`, of `bytes`: the size of the node's type in
// `trefoil.h`. Samples at which a fault leaves the node without a process are flown without an answer. Returns 1:
// answer by `trefoil_flight_answer`. 0: the flight is over. Below 0: an error.
int32_t trefoil_flight_next(struct TrefoilFlight *flight, void *input, size_t bytes);

// Sends `answer`, of `bytes`: the size of the node's type in `trefoil.h`. Returns 0, or below 0 on an error.
int32_t trefoil_flight_answer(struct TrefoilFlight *flight, const void *answer, size_t bytes);

// Returns the record of the flight: run.json as text, with `stepped`, the caller's node. A flight that is not over
// ends here, as interrupted. Valid until `trefoil_flight_close`; NULL on an error.
const char *trefoil_flight_record(struct TrefoilFlight *flight);

// Returns the reason of the last error; valid until the next call.
const char *trefoil_flight_error(const struct TrefoilFlight *flight);

// Frees the flight. Does nothing if `flight` is NULL.
void trefoil_flight_close(struct TrefoilFlight *flight);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus
