from studies.accuracy.study import main

main()
